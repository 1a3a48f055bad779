"""What leaves: obstacles, heartbeats, texts."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from link_support import Conversation, Flight, Voice, clear_scan
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.autopilot.obstacle_gate import ObstacleGate, Refusal
from service.autopilot.service_state import ServiceState
from service.autopilot.status_text import StatusTexts

S, MS = 1_000_000_000, 1_000_000


def connected(**settings: object) -> tuple[Conversation, Flight]:
    talk = Conversation(S, **settings)
    flight = Flight(talk, Voice(3))
    flight.fly(1.0)
    return talk, flight


def offer(talk: Conversation, captured_ns: int, congested: bool = False) -> bool:
    sent = talk.session.send_obstacles(clear_scan(), captured_ns, talk.now_ns, congested)
    talk.wait_s(0.02)
    return sent


def test_a_fresh_scan_leaves_as_obstacle_distance() -> None:
    talk, _ = connected()
    assert offer(talk, talk.now_ns - 60 * MS)
    ((_, message),) = talk.sent_of("OBSTACLE_DISTANCE")
    assert message.get_srcSystem() == 3
    assert message.get_srcComponent() == 196
    assert (message.frame, message.angle_offset, message.increment_f) == (12, -155.0, 5.0)
    assert set(message.distances) == {2001}
    assert message.time_usec == 0, "the clocks are not bound: 0 rather than a guess"
    assert talk.session.status(talk.now_ns).sent_obstacles == 1


def test_the_capture_time_is_told_on_the_autopilots_clock_once_the_clocks_are_bound() -> None:
    talk, flight = connected()
    now_ns = talk.now_ns
    request = talk.sent_of("TIMESYNC")[-1][1]
    answer = mavlink.MAVLink_timesync_message((flight.boot_ms(request.ts1) + 1) * MS, request.ts1)
    talk.session.receive(Voice(3).pack(answer), request.ts1 + 2 * MS)
    assert offer(talk, now_ns - 60 * MS)
    captured_us = talk.sent_of("OBSTACLE_DISTANCE")[0][1].time_usec
    assert captured_us == pytest.approx((now_ns - 60 * MS) // 1000 + flight.offset_ms * 1000, abs=3000)


def test_r8_a_frame_older_than_300_ms_never_leaves() -> None:
    talk, _ = connected()
    assert not offer(talk, talk.now_ns - 301 * MS)
    assert offer(talk, talk.now_ns - 299 * MS)
    assert talk.session.status(talk.now_ns).refused_obstacles == {"too_old": 1}


def test_r8_a_scan_that_grew_old_while_it_waited_does_not_leave() -> None:
    talk, _ = connected()
    assert talk.session.send_obstacles(clear_scan(), talk.now_ns - 200 * MS, talk.now_ns)
    assert talk.session.take_output(talk.now_ns + 150 * MS) == []
    assert talk.session.status(talk.now_ns).sent_obstacles == 0


def test_a_frame_leaves_once_and_never_after_a_newer_one() -> None:
    talk, _ = connected()
    captured_ns = talk.now_ns - 20 * MS
    assert offer(talk, captured_ns)
    talk.wait_s(0.1)
    assert not offer(talk, captured_ns)
    assert not offer(talk, captured_ns - 10 * MS)
    assert talk.session.status(talk.now_ns).refused_obstacles == {"not_new": 2}


def test_nothing_leaves_before_an_autopilot_is_heard_or_after_it_is_lost() -> None:
    talk = Conversation(S)
    assert not offer(talk, talk.now_ns)
    Flight(talk, Voice()).fly(1.0)
    assert offer(talk, talk.now_ns)
    talk.wait_s(3.2)
    assert not offer(talk, talk.now_ns)
    assert talk.session.status(talk.now_ns).refused_obstacles == {"not_connected": 2}


def test_nothing_is_added_to_a_line_that_is_full() -> None:
    talk, _ = connected()
    assert not offer(talk, talk.now_ns, congested=True)
    assert talk.session.status(talk.now_ns).refused_obstacles == {"congested": 1}


@pytest.mark.parametrize(
    ("camera_hz", "expected_hz"), [(10, 10), (14, 14), (16, 15), (20, 15), (30, 15), (60, 15)]
)
def test_the_rate_is_kept_whatever_the_cameras_is(camera_hz: float, expected_hz: float) -> None:
    gate, sent = ObstacleGate(15.0, 300 * MS), []
    for frame in range(int(20 * camera_hz)):
        captured_ns = S + round(frame * 1e9 / camera_hz)
        if gate.refusal(captured_ns, captured_ns + 50 * MS) is None:
            gate.passed(captured_ns, captured_ns + 50 * MS)
            sent.append(captured_ns)
    assert len(sent) / 20 == pytest.approx(expected_hz, rel=0.03)
    assert np.diff(sent).max() <= 2.1e9 / min(camera_hz, 15), "no gap wider than two periods"


@given(st.lists(st.tuples(st.integers(0, 10**9), st.integers(-(10**8), 10**9)), max_size=50))
def test_whatever_passes_the_gate_is_fresh_and_newer_than_the_last(offers: list[tuple[int, int]]) -> None:
    gate, now_ns, newest_ns = ObstacleGate(15.0, 300 * MS), 0, -1
    for elapsed_ns, age_ns in offers:
        now_ns += elapsed_ns
        captured_ns = max(0, now_ns - age_ns)
        if gate.refusal(captured_ns, now_ns) is None:
            assert 0 <= now_ns - captured_ns <= 300 * MS
            assert captured_ns > newest_ns
            gate.passed(captured_ns, now_ns)
            newest_ns = captured_ns


def test_a_capture_in_the_future_is_refused() -> None:
    assert ObstacleGate(15.0, 300 * MS).refusal(S + 1, S) is Refusal.TOO_OLD


def test_the_first_obstacles_may_leave_within_a_moment_of_the_first_heartbeat() -> None:
    talk = Conversation(S)
    talk.hear(Voice().heartbeat())
    assert offer(talk, talk.now_ns)
    assert talk.sent_of("OBSTACLE_DISTANCE")


def test_r18_heartbeats_go_out_once_a_second_as_an_onboard_controller() -> None:
    talk = Conversation(S)
    Flight(talk, Voice(3)).fly(20.0)
    times, beats = zip(*talk.sent_of("HEARTBEAT"), strict=True)
    assert np.diff(times) == pytest.approx(1e9, rel=0.05)
    assert {(m.type, m.autopilot, m.system_status) for m in beats} == {(18, 8, mavlink.MAV_STATE_BOOT)}


def test_a_change_of_state_is_told_at_once_and_the_rhythm_stays() -> None:
    talk = Conversation(S)
    talk.wait_s(5.5)
    talk.session.set_state(ServiceState.ACTIVE)
    talk.wait_s(0.02)
    at_ns, beat = talk.sent_of("HEARTBEAT")[-1]
    assert talk.now_ns - at_ns <= 20 * MS
    assert beat.system_status == mavlink.MAV_STATE_ACTIVE
    talk.wait_s(4.5)
    assert len(talk.sent_of("HEARTBEAT")) == pytest.approx(12, abs=1)


def test_a_flapping_state_does_not_flood_the_line() -> None:
    talk = Conversation(S)
    for step in range(500):
        talk.session.set_state(ServiceState.ACTIVE if step % 2 else ServiceState.CRITICAL)
        talk.wait_s(0.02)
    assert len(talk.sent_of("HEARTBEAT")) <= 10 * 6 + 2


@pytest.mark.parametrize(
    ("state", "word"),
    [(ServiceState.BOOT, 1), (ServiceState.STANDBY, 3), (ServiceState.ACTIVE, 4), (ServiceState.CRITICAL, 5)],
)
def test_states_are_mavlinks(state: ServiceState, word: int) -> None:
    talk = Conversation(S)
    talk.wait_s(0.5)
    talk.session.set_state(state)
    talk.wait_s(1.0)
    assert talk.sent_of("HEARTBEAT")[-1][1].system_status == word


def test_a_text_reaches_the_pilot_once() -> None:
    talk, flight = connected()
    for _ in range(8):
        talk.session.say(4, "Depth not trusted", talk.now_ns)
        flight.fly(1.0)
    assert [m.text for _, m in talk.sent_of("STATUSTEXT")] == ["Depth not trusted"]
    flight.fly(3.0)
    talk.session.say(4, "Depth not trusted", talk.now_ns)
    flight.fly(1.0)
    assert len(talk.sent_of("STATUSTEXT")) == 2


def test_texts_wait_for_the_autopilot() -> None:
    talk = Conversation(S)
    talk.session.say(6, "Service started", talk.now_ns)
    talk.wait_s(2.0)
    assert talk.sent_of("STATUSTEXT") == []
    Flight(talk, Voice()).fly(0.1)
    talk.wait_s(0.02)
    assert [m.text for _, m in talk.sent_of("STATUSTEXT")] == ["Service started"]


@pytest.mark.parametrize("length", [1, 49, 50, 51, 99, 100, 101, 199, 200, 500])
def test_a_long_text_comes_in_chunks_that_can_be_joined(length: int) -> None:
    texts, text = StatusTexts(), "".join(chr(97 + i % 26) for i in range(length))
    texts.say(3, text, 0)
    chunks = texts.due(0)
    assert b"".join(chunk._text_raw for chunk in chunks).decode() == text[:200]
    assert [chunk.chunk_seq for chunk in chunks] == list(range(len(chunks)))
    assert len({chunk.id for chunk in chunks}) == 1
    assert (chunks[0].id == 0) == (length <= 50)
    if length > 50:
        assert len(chunks[-1]._text_raw) < 50, "a chunk that is not full ends the text"


def test_texts_are_kept_to_two_a_second_and_eight_waiting() -> None:
    texts = StatusTexts()
    for number in range(100):
        texts.say(6, f"text {number}", 0)
    said = [m for t in range(0, 10 * S, 20 * MS) for m in texts.due(t)]
    assert [m.text for m in said] == [f"text {number}" for number in range(92, 100)]


@given(st.text(max_size=300), st.integers(-5, 300))
def test_any_text_can_be_packed(text: str, severity: int) -> None:
    texts, voice = StatusTexts(), Voice()
    texts.say(severity, text, 0)
    for message in texts.due(0):
        voice.pack(message)


def test_bytes_are_counted() -> None:
    talk, flight = connected()
    flight.fly(3.0)
    status = talk.session.status(talk.now_ns)
    assert 1000 < status.bytes_in_per_s < 5000
    assert 10 < status.bytes_out_per_s < 500
