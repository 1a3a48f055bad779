"""With a key only the key's holders are believed, and what leaves is accepted by them."""

from __future__ import annotations

import hashlib
import itertools
import socket
import time
from contextlib import closing, suppress
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from link_support import SECOND_NS as S
from link_support import TICK_NS, Voice, clear_scan, message_id
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.autopilot.link import AutopilotLink
from service.autopilot.link_status import LinkStatus
from service.autopilot.session import LinkSession
from service.autopilot.signing import LINK_ID, Signing, Verdict
from service.autopilot.signing_key import SigningKey, load_signing_key
from service.clock import MonotonicClock
from service.errors import LinkError
from service.settings.autopilot import AutopilotSettings

KEY, OTHER_KEY = SigningKey(bytes(range(32))), SigningKey(bytes(range(1, 33)))
YEARS = 11 * 365 * 24 * 3600 * 100_000
"""A time stamp of these years: 10 microseconds since 2015."""
SECOND = 100_000
PATIENCE_S = 20.0
"""How long a test waits for what must come; nothing is asserted of how soon it does."""


class SignedVoice(Voice):
    """An autopilot whose packets pymavlink signs."""

    def __init__(
        self, key: SigningKey = KEY, stamp: int = YEARS, link_id: int = 0, component_id: int = 1
    ) -> None:
        super().__init__(1, component_id)
        self.signing = self._codec.signing
        self.signing.secret_key, self.signing.timestamp = key.secret, stamp
        self.signing.link_id, self.signing.sign_outgoing = link_id, True


class Listener:
    """A MAVLink party that, like an autopilot, takes only packets signed with the key; pymavlink's check."""

    def __init__(self, key: SigningKey = KEY, stamp: int = YEARS) -> None:
        self.codec = mavlink.MAVLink(None)
        self.codec.signing.secret_key, self.codec.signing.timestamp = key.secret, stamp

    def takes(self, frame: bytes) -> bool:
        try:
            self.codec.decode(bytearray(frame))
        except mavlink.MAVError:
            return False
        return True


class Link:
    """A session with a key, and the frames that leave."""

    def __init__(self, key: SigningKey | None = KEY) -> None:
        self.session = LinkSession(AutopilotSettings(), key)
        self.now_ns = S
        self.session.line_opened(S)

    def hear(self, frame: bytes) -> None:
        self.session.receive(frame, self.now_ns)

    def speak(self, seconds: float = 0.02) -> list[bytes]:
        frames, end_ns = [], self.now_ns + round(seconds * S)
        while self.now_ns < end_ns:
            self.now_ns += TICK_NS
            self.session.tick(self.now_ns)
            frames += self.session.take_output(self.now_ns)
        return frames

    def send_obstacles(self) -> bool:
        return self.session.send_obstacles(clear_scan(), self.now_ns, self.now_ns)

    @property
    def status(self) -> LinkStatus:
        return self.session.status(self.now_ns)


def stamp_of(frame: bytes) -> int:
    return int.from_bytes(frame[-12:-6], "little")


def test_an_autopilot_with_the_key_is_heard_and_takes_every_packet_of_ours() -> None:
    link, voice, autopilot = Link(), SignedVoice(), Listener()
    link.hear(voice.heartbeat())
    assert link.send_obstacles()
    frames = link.speak(2.0)
    kinds = {int.from_bytes(frame[7:10], "little") for frame in frames}
    assert {0, 76, 111, 330} <= kinds
    assert all(autopilot.takes(frame) for frame in frames)
    assert link.status.signed
    assert link.status.refused_packets == {}


def test_what_leaves_carries_one_link_id_and_stamps_that_only_grow() -> None:
    link, voice = Link(), SignedVoice()
    frames = []
    for _ in range(5):
        link.hear(voice.heartbeat())
        frames += link.speak(1.0)
    assert {frame[-13] for frame in frames} == {LINK_ID}
    stamps = [stamp_of(frame) for frame in frames]
    assert all(later > earlier for earlier, later in itertools.pairwise(stamps))


def test_our_stamps_follow_the_autopilots_and_never_push_its_clock() -> None:
    link, voice = Link(), SignedVoice()
    for jump in (0, 20 * SECOND, 3600 * SECOND):
        voice.signing.timestamp += jump
        link.hear(voice.heartbeat())
        newest = voice.signing.timestamp
        frames = link.speak(1.0)
        assert frames
        assert all(newest - SECOND < stamp_of(frame) < newest + SECOND for frame in frames)


def test_a_ground_station_with_a_fast_clock_does_not_move_our_stamps() -> None:
    link, voice = Link(), SignedVoice()
    link.hear(voice.heartbeat())
    link.hear(SignedVoice(stamp=YEARS + 3600 * SECOND, component_id=190).heartbeat(kind=6, autopilot=8))
    link.hear(voice.attitude(1000))
    assert all(stamp_of(frame) < YEARS + SECOND for frame in link.speak(1.0))


def test_a_service_that_was_restarted_is_taken_again() -> None:
    voice, autopilot = SignedVoice(), Listener()
    for _ in range(3):
        link = Link()
        # An autopilot signs later than everything it has accepted.
        voice.signing.timestamp = max(voice.signing.timestamp, autopilot.codec.signing.timestamp + 1)
        link.hear(voice.heartbeat())
        frames = link.speak(1.5)
        assert frames
        assert all(autopilot.takes(frame) for frame in frames)


@pytest.mark.parametrize(
    ("frame", "why", "text"),
    [
        (Voice().heartbeat(), "unsigned", "are not signed"),
        (Voice().heartbeat(mavlink1=True), "unsigned", "are not signed"),
        (SignedVoice(OTHER_KEY).heartbeat(), "wrong_signature", "with another key"),
    ],
)
def test_a_packet_without_the_right_signature_is_as_if_it_had_not_come(
    frame: bytes, why: str, text: str
) -> None:
    link = Link()
    link.hear(frame)
    assert link.status.system_id is None
    assert not link.status.connected
    assert not link.send_obstacles()
    assert link.status.refused_packets == {why: 1}
    assert text in (link.status.problem or "")
    link.hear(SignedVoice().heartbeat())
    assert link.status.connected
    assert link.status.problem is None


def test_forged_packets_among_good_ones_change_nothing_and_do_not_fill_the_log() -> None:
    link, voice = Link(), SignedVoice()
    link.hear(voice.heartbeat())
    link.session.take_notices()
    for _ in range(100):
        link.hear(Voice().heartbeat(custom_mode=9))
        link.hear(SignedVoice(OTHER_KEY, YEARS + 10**9).heartbeat(custom_mode=9))
        link.hear(voice.heartbeat(custom_mode=5))
    assert link.status.mode == "LOITER"
    assert link.session.take_notices() == []
    assert link.status.refused_packets == {"unsigned": 100, "wrong_signature": 100}


def test_a_replayed_packet_is_refused() -> None:
    link, voice = Link(), SignedVoice()
    recorded = [voice.heartbeat(custom_mode=9), voice.attitude(1000)]
    link.hear(voice.heartbeat(custom_mode=5))
    for frame in recorded * 3:
        link.hear(frame)
    assert link.status.mode == "LOITER"
    assert link.status.refused_packets == {"old_timestamp": 6}


def test_the_same_packet_twice_counts_once() -> None:
    link, frame = Link(), SignedVoice().heartbeat()
    link.hear(frame)
    link.hear(frame)
    assert link.status.refused_packets == {"old_timestamp": 1}


@pytest.mark.parametrize(("behind_s", "verdict"), [(0, Verdict.GOOD), (59, Verdict.GOOD), (61, Verdict.OLD)])
def test_another_link_id_is_another_stream_that_must_be_less_than_60_s_behind(
    behind_s: int, verdict: Verdict
) -> None:
    signing = Signing(KEY)
    assert signing.verdict(SignedVoice(stamp=YEARS).heartbeat()) is Verdict.GOOD
    late = SignedVoice(stamp=YEARS - behind_s * SECOND, link_id=7)
    assert signing.verdict(late.heartbeat()) is verdict


def test_a_forged_packet_from_the_future_does_not_shut_the_stream_out() -> None:
    signing, voice = Signing(KEY), SignedVoice()
    assert signing.verdict(voice.heartbeat()) is Verdict.GOOD
    assert signing.verdict(SignedVoice(OTHER_KEY, YEARS + 10**9).heartbeat()) is Verdict.WRONG
    assert signing.verdict(voice.heartbeat()) is Verdict.GOOD


@given(st.integers(0, 8 * 60), st.integers(1, 255))
def test_no_changed_byte_of_a_signed_packet_is_believed(place: int, change: int) -> None:
    frame = bytearray(SignedVoice().heartbeat())
    place %= len(frame)
    frame[place] ^= change
    assert Signing(KEY).verdict(frame) is not Verdict.GOOD


def test_an_autopilot_that_signs_while_no_key_is_set_is_a_problem_that_is_told() -> None:
    link = Link(None)
    link.hear(SignedVoice().heartbeat())
    assert "signing_key_file is empty" in (link.status.problem or "")
    assert all(not frame[2] & 1 for frame in link.speak(1.0))
    link.hear(Voice().heartbeat())
    assert link.status.problem is None


def test_over_a_socket_a_signing_autopilot_and_the_link_believe_each_other(tmp_path: Path) -> None:
    key_file = written(tmp_path, b"passphrase: correct horse")
    link = AutopilotLink(
        AutopilotSettings(endpoint="udp:127.0.0.1:0", signing_key_file=str(key_file)), MonotonicClock()
    )
    key = SigningKey(hashlib.sha256(b"correct horse").digest())
    voice, autopilot, frames = SignedVoice(key), Listener(key), list[bytes]()
    end_s = time.monotonic() + PATIENCE_S
    with closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as peer, closing(link):
        link.start()
        peer.connect(("127.0.0.1", link.listen_port))
        peer.settimeout(0.05)
        while not {0, 76, 111} <= {message_id(frame) for frame in frames}:
            assert time.monotonic() < end_s, f"waited in vain, heard {len(frames)} packets"
            peer.send(voice.heartbeat())
            with suppress(TimeoutError):
                frames.append(peer.recv(1000))
        assert link.status().connected
        assert link.status().signed
    assert all(autopilot.takes(frame) for frame in frames)


class TestKeyFile:
    def test_32_bytes_are_the_key(self, tmp_path: Path) -> None:
        path = written(tmp_path, KEY.secret)
        assert load_signing_key(path) == KEY

    @pytest.mark.parametrize("text", [b"passphrase: correct horse\n", b"passphrase:correct horse"])
    def test_a_passphrase_is_hashed_as_ground_stations_do(self, tmp_path: Path, text: bytes) -> None:
        assert load_signing_key(written(tmp_path, text)).secret == hashlib.sha256(b"correct horse").digest()

    @pytest.mark.parametrize(
        ("data", "text"),
        [
            (b"", "holds 0 bytes: exactly 32"),
            (b"x" * 31, "holds 31 bytes"),
            (b"x" * 32 + b"\n", "holds 33 bytes"),
            (b"x" * 5000, "more than 4096 bytes"),
            (bytes(32), "is all zero"),
            (b"passphrase:  \n", "the passphrase is empty"),
            (b"passphrase: a\nb\n", "more than one line"),
        ],
    )
    def test_another_file_is_refused_with_its_name(self, tmp_path: Path, data: bytes, text: str) -> None:
        path = written(tmp_path, data)
        with pytest.raises(LinkError, match=text) as refusal:
            load_signing_key(path)
        assert str(path) in str(refusal.value)

    def test_a_missing_file_and_a_folder_are_refused(self, tmp_path: Path) -> None:
        with pytest.raises(LinkError, match="no such file"):
            load_signing_key(tmp_path / "key")
        with pytest.raises(LinkError, match="cannot be read"):
            load_signing_key(tmp_path)

    @pytest.mark.parametrize(
        ("mode", "warned"), [(0o600, False), (0o400, False), (0o640, True), (0o644, True)]
    )
    def test_a_key_that_others_can_read_is_warned_about(
        self, tmp_path: Path, mode: int, warned: bool
    ) -> None:
        path = written(tmp_path, KEY.secret)
        path.chmod(mode)
        warning = load_signing_key(path).warning
        assert (warning is not None) is warned
        assert warning is None or "chmod 600" in warning

    def test_the_key_is_never_shown(self) -> None:
        assert "secret" not in repr(KEY)

    def test_a_link_with_a_wrong_key_file_does_not_start(self, tmp_path: Path) -> None:
        settings = AutopilotSettings(endpoint="udp:127.0.0.1:0", signing_key_file=str(tmp_path / "key"))
        link = AutopilotLink(settings, MonotonicClock())
        with pytest.raises(LinkError, match="no such file"):
            link.start()
        link.close()


def written(folder: Path, data: bytes) -> Path:
    path = folder / "signing.key"
    path.write_bytes(data)
    path.chmod(0o600)
    return path
