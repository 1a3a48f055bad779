"""Streams are asked for until they really come."""

from __future__ import annotations

from itertools import pairwise

import pytest
from link_support import Conversation, Flight, Voice
from pymavlink.dialects.v20 import ardupilotmega as mavlink

S = 1_000_000_000
ATTITUDE, POSITION, DISTANCE = 30, 32, 132


def asked(talk: Conversation, message_id: int, since_ns: int = 0) -> list[int]:
    return [at for at, m in talk.sent_of("COMMAND_LONG", since_ns) if m.param1 == message_id]


def test_all_streams_are_asked_for_as_soon_as_the_autopilot_is_heard() -> None:
    talk = Conversation(S)
    talk.hear(Voice(4).heartbeat())
    talk.wait_s(0.02)
    requests = [m for _, m in talk.sent_of("COMMAND_LONG")]
    assert {(m.param1, m.param2) for m in requests} == {(30, 20_000), (32, 33_333), (132, 50_000)}
    assert {(m.command, m.target_system, m.target_component) for m in requests} == {
        (mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, 4, 1)
    }
    assert len(talk.sent_of("TIMESYNC")) == 1


def test_a_stream_that_comes_is_not_asked_for_again() -> None:
    talk = Conversation(S)
    Flight(talk, Voice()).fly(10.0)
    assert len(asked(talk, ATTITUDE)) == 1
    assert len(asked(talk, POSITION)) == 1
    assert len(asked(talk, DISTANCE)) >= 3, "the one that does not come is"


def test_an_acknowledged_request_that_is_not_honoured_is_repeated_ever_more_slowly() -> None:
    talk, voice = Conversation(S), Voice()
    for _ in range(30):
        talk.hear(voice.heartbeat())
        talk.hear(voice.pack(mavlink.MAVLink_command_ack_message(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, 0)))
        talk.wait_s(1.0)
    times = asked(talk, ATTITUDE)
    gaps = [(b - a) / S for a, b in pairwise(times)]
    assert gaps[:2] == pytest.approx([1.5, 3.0], abs=0.05)
    assert all(gap == pytest.approx(5.0, abs=0.05) for gap in gaps[2:])
    problem = talk.session.status(talk.now_ns).problem
    assert problem is not None
    assert "ATTITUDE at 50 Hz" in problem


def test_a_stream_that_grows_thin_is_asked_for_again() -> None:
    talk, voice = Conversation(S), Voice()
    flight = Flight(talk, voice)
    flight.fly(5.0)
    thin_ns = talk.now_ns
    for _ in range(4):
        talk.hear(voice.heartbeat())
        for _ in range(4):
            talk.hear(voice.attitude(flight.boot_ms(talk.now_ns)))
            talk.wait_s(0.25)
    assert asked(talk, ATTITUDE, thin_ns)


def test_streams_are_asked_for_again_when_the_clock_begins_anew() -> None:
    talk, voice = Conversation(S), Voice()
    Flight(talk, voice, offset_ms=100_000).fly(5.0)
    before_ns = talk.now_ns
    Flight(talk, voice, offset_ms=-5_900).fly(0.1)
    talk.wait_s(0.02)
    assert talk.session.status(talk.now_ns).reboots == 1
    assert {m.param1 for _, m in talk.sent_of("COMMAND_LONG", before_ns)} == {30, 32, 132}


def test_streams_are_asked_for_again_after_a_silence_and_a_new_line() -> None:
    talk, voice = Conversation(S), Voice()
    flight = Flight(talk, voice)
    flight.fly(4.0)
    talk.wait_s(4.0)
    back_ns = talk.now_ns
    flight.fly(0.1)
    assert {m.param1 for _, m in talk.sent_of("COMMAND_LONG", back_ns)} == {30, 32, 132}
    assert any("back after" in notice for notice in talk.notices)
    talk.session.line_failed("gone")
    assert not talk.session.status(talk.now_ns).connected
    talk.session.line_opened(talk.now_ns)
    open_ns = talk.now_ns
    flight.fly(0.1)
    assert {m.param1 for _, m in talk.sent_of("COMMAND_LONG", open_ns)} == {30, 32, 132}


def test_rates_are_those_that_arrive() -> None:
    talk = Conversation(S)
    Flight(talk, Voice()).fly(5.0)
    rates = talk.session.status(talk.now_ns).rates_hz
    assert rates["ATTITUDE"] == pytest.approx(50, abs=2)
    assert rates["LOCAL_POSITION_NED"] == pytest.approx(25, abs=2)
    assert rates["DISTANCE_SENSOR"] == 0
    talk.wait_s(3.0)
    assert talk.session.status(talk.now_ns).rates_hz["ATTITUDE"] == 0


def test_timesync_goes_both_ways_and_binds_the_clocks() -> None:
    talk, voice = Conversation(S), Voice()
    flight = Flight(talk, voice)
    flight.fly(0.2)
    for _, request in talk.sent_of("TIMESYNC"):
        boot_ns = (flight.boot_ms(request.ts1) + 1) * 1_000_000
        talk.session.receive(
            voice.pack(mavlink.MAVLink_timesync_message(boot_ns, request.ts1)), request.ts1 + 2_000_000
        )
    status = talk.session.status(talk.now_ns)
    assert status.clock_synced
    assert status.clock_offset_s == pytest.approx(-10.0, abs=0.003)
    talk.hear(voice.pack(mavlink.MAVLink_timesync_message(0, 777)))
    talk.wait_s(0.02)
    assert [m.ts1 for _, m in talk.sent_of("TIMESYNC") if m.tc1 != 0] == [777]
