"""Bytes of any quality: what is a message comes out, what is not does no harm."""

from __future__ import annotations

import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from link_support import Conversation, Voice, read_tlog
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.autopilot.framing import FrameReader, is_mavlink1

VOICE = Voice()
FRAMES = [
    VOICE.heartbeat(),
    VOICE.attitude(1000, roll=0.1),
    VOICE.distance(1000, 500),
    VOICE.heartbeat(mavlink1=True),
]


def names(reader: FrameReader, data: bytes) -> list[str]:
    return [message.get_type() for message in reader.read(data)]


def test_frames_come_out_however_the_bytes_are_cut() -> None:
    stream = b"".join(FRAMES)
    for size in (1, 2, 3, 7, 50, len(stream)):
        reader = FrameReader()
        found = [name for i in range(0, len(stream), size) for name in names(reader, stream[i : i + size])]
        assert found == ["HEARTBEAT", "ATTITUDE", "DISTANCE_SENSOR", "HEARTBEAT"]
        assert reader.bad_bytes == 0


def test_garbage_costs_no_good_frame_behind_it() -> None:
    reader = FrameReader()
    assert (
        names(reader, b"\xfd\x20\x00garbage\xfe" + FRAMES[1] + FRAMES[0] * 12)
        == ["ATTITUDE"] + ["HEARTBEAT"] * 12
    )
    assert reader.bad_bytes == 11


def test_a_truncated_frame_costs_only_itself() -> None:
    assert names(FrameReader(), FRAMES[1][:-5] + FRAMES[0] + FRAMES[1]) == ["HEARTBEAT", "ATTITUDE"]


def test_a_flipped_bit_costs_the_frame() -> None:
    for byte in range(len(FRAMES[1])):
        broken = bytearray(FRAMES[1])
        broken[byte] ^= 0x10
        found = FrameReader().read(bytes(broken) + FRAMES[0] * 12)
        assert [m.get_type() for m in found[-11:]] == ["HEARTBEAT"] * 11
        assert all(m.get_type() != "ATTITUDE" for m in found)


def test_messages_that_are_not_needed_and_unknown_ones_are_passed_over() -> None:
    vfr = VOICE.pack(mavlink.MAVLink_vfr_hud_message(1.0, 1.0, 10, 20, 5.0, 0.0))
    unknown = b"\xfd\x04\x00\x00\x07\x01\x01\xf0\xd8\x00" + b"\xfd\xfe\xfd\x00" + b"\x12\x34"
    reader = FrameReader()
    assert names(reader, vfr + unknown + FRAMES[1]) == ["ATTITUDE"]
    assert reader.bad_bytes == 0


def test_both_versions_are_told_apart() -> None:
    assert [is_mavlink1(m) for m in FrameReader().read(FRAMES[0] + FRAMES[3])] == [False, True]


def test_a_flood_without_frames_is_not_kept() -> None:
    reader = FrameReader()
    for _ in range(200):
        assert reader.read(b"\xfd" * 997) == []
    assert len(reader._buffer) <= 1024


@given(st.binary(max_size=600))
def test_no_bytes_raise(data: bytes) -> None:
    FrameReader().read(data)


@settings(max_examples=200)
@given(st.lists(st.one_of(st.sampled_from(FRAMES), st.binary(max_size=40)), max_size=12), st.randoms())
def test_frames_among_garbage_raise_nothing_in_the_session(
    pieces: list[bytes], chance: random.Random
) -> None:
    talk = Conversation(10**9)
    stream = b"".join(pieces)
    while stream:
        cut = chance.randint(1, len(stream))
        talk.hear(stream[:cut], source=chance.choice([None, ("10.0.0.1", 1), ("10.0.0.2", 2)]))
        talk.wait_s(0.02)
        stream = stream[cut:]
    talk.session.status(talk.now_ns)
    talk.session.telemetry_at(talk.now_ns, talk.now_ns)


FLOATS = st.floats(width=32, allow_nan=True, allow_infinity=True)


@settings(max_examples=200)
@given(
    st.lists(
        st.tuples(
            st.integers(0, 2**32 - 1), FLOATS, FLOATS, FLOATS, st.integers(0, 65535), st.integers(0, 255)
        ),
        max_size=10,
    )
)
def test_no_content_raises_in_the_session(contents: list[tuple[int, float, float, float, int, int]]) -> None:
    talk, voice = Conversation(10**9), Voice()
    talk.hear(voice.heartbeat())
    for boot_ms, a, b, c, words, byte in contents:
        talk.hear(voice.pack(mavlink.MAVLink_attitude_message(boot_ms, a, b, c, b, c, a)))
        talk.hear(voice.pack(mavlink.MAVLink_local_position_ned_message(boot_ms, a, b, c, c, b, a)))
        talk.hear(voice.distance(boot_ms, words, orientation=25, sensor_id=byte, quality=byte))
        talk.hear(voice.pack(mavlink.MAVLink_timesync_message(boot_ms * 2**20, words)))
        talk.hear(voice.heartbeat(kind=byte, autopilot=byte, base_mode=byte, custom_mode=boot_ms))
        talk.wait_s(0.02)
        telemetry = talk.session.telemetry_at(talk.now_ns - 20_000_000, talk.now_ns)
        if telemetry.attitude is not None:
            assert abs(telemetry.attitude.pitch_rad) <= 1.5708
        talk.session.newest_pose(talk.now_ns)


@pytest.mark.parametrize("seed", range(3))
def test_a_recording_with_holes_raises_nothing(seed: int) -> None:
    """A tenth of flight D, with bytes lost, doubled and flipped."""
    chance = random.Random(seed)
    arrivals = read_tlog("D_reboot_and_link_pause.tlog")[seed * 3000 : (seed + 1) * 3000]
    talk = Conversation(arrivals[0].at_ns)
    for arrival in arrivals:
        data = bytearray(arrival.data)
        fate = chance.random()
        if fate < 0.05:
            del data[chance.randrange(len(data)) :]
        elif fate < 0.10:
            data[chance.randrange(len(data))] ^= 1 << chance.randrange(8)
        elif fate < 0.12:
            data = data * 2
        talk.hear(bytes(data), arrival.at_ns)
    status = talk.session.status(talk.now_ns)
    assert status.system_id == 1
    assert status.rates_hz["ATTITUDE"] > 40
    assert status.bad_bytes > 0
