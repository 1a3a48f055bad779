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
from link_support import Voice, message_id
from signing_support import KEY, OTHER_KEY, SECOND, YEARS, Link, Listener, SignedVoice, stamp_of, written

from service.autopilot.link import AutopilotLink
from service.autopilot.signing import LINK_ID, Signing, Verdict
from service.autopilot.signing_key import SigningKey
from service.clock import MonotonicClock
from service.settings.autopilot import AutopilotSettings

PATIENCE_S = 20.0
"""How long a test waits for what must come; nothing is asserted of how soon it does."""


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
