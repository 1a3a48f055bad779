"""Attitude, position and height between messages, and what is not known."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from link_support import Conversation, Flight, Voice

from service.autopilot.motion_history import MotionHistory, MotionLimits
from service.autopilot.quaternion import from_attitude, slerp, to_attitude, turned
from uavdepth.attitude import Attitude

S, MS = 1_000_000_000, 1_000_000
ANGLES = st.floats(-math.pi, math.pi)
PITCHES = st.floats(-1.5, 1.5)
STILL = (0.0, 0.0, 0.0)


def history(*attitudes: tuple[int, Attitude], rates: tuple[float, float, float] = STILL) -> MotionHistory:
    motion = MotionHistory(MotionLimits())
    for at_ms, attitude in attitudes:
        motion.add_attitude(at_ms * MS, attitude, rates)
    return motion


def angle_between(a: Attitude, b: Attitude) -> float:
    turn = a.ned_from_body.T @ b.ned_from_body
    return math.acos(min(1.0, max(-1.0, (np.trace(turn) - 1) / 2)))


@given(ANGLES, PITCHES, ANGLES)
def test_quaternions_keep_the_attitude(roll: float, pitch: float, yaw: float) -> None:
    attitude = Attitude(roll, pitch, yaw)
    back = to_attitude(from_attitude(attitude))
    assert back.ned_from_body == pytest.approx(attitude.ned_from_body, abs=1e-9)


@given(ANGLES, PITCHES, ANGLES, ANGLES, PITCHES, ANGLES, st.floats(0, 1))
def test_the_way_between_two_attitudes_is_the_short_one(
    r1: float, p1: float, y1: float, r2: float, p2: float, y2: float, fraction: float
) -> None:
    a, b = Attitude(r1, p1, y1), Attitude(r2, p2, y2)
    middle = to_attitude(slerp(from_attitude(a), from_attitude(b), fraction))
    whole = angle_between(a, b)
    assert angle_between(a, middle) == pytest.approx(fraction * whole, abs=2e-6 + 1e-3 * (whole > 3.1))


def test_yaw_is_interpolated_across_north_and_south() -> None:
    for centre in (0.0, math.pi):
        motion = history(
            (0, Attitude(0, 0, centre - 0.1)), (20, Attitude(0, 0, math.remainder(centre + 0.1, math.tau)))
        )
        middle = motion.attitude_at(10 * MS)
        assert middle is not None
        assert abs(math.remainder(middle.yaw_rad - centre, math.tau)) < 1e-9


def test_beyond_the_newest_message_the_rates_carry_for_50_ms() -> None:
    motion = history((100, Attitude(0.1, 0, 1.0)), rates=(0.0, 0.0, 2.0))
    ahead = motion.attitude_at(140 * MS)
    assert ahead is not None
    expected = to_attitude(turned(from_attitude(Attitude(0.1, 0, 1.0)), (0.0, 0.0, 2.0), 0.04))
    assert angle_between(ahead, expected) < 1e-6
    assert angle_between(ahead, Attitude(0.1, 0, 1.0)) == pytest.approx(0.08, abs=1e-6)
    assert motion.attitude_at(150 * MS) is not None
    assert motion.attitude_at(151 * MS) is None


def headings(
    *yaws: tuple[int, float], rate_rps: float = 1e-3, start: float = 3.0
) -> tuple[MotionHistory, list[float]]:
    """Messages of yaw after `start` while the nose turns at a rate; the resets so far at each, in order."""
    motion = MotionHistory(MotionLimits())
    for at_ms, yaw in yaws:
        attitude = Attitude(0.1, -0.2, math.remainder(start + yaw, math.tau))
        motion.add_attitude(at_ms * MS, attitude, (0.0, rate_rps * math.sin(0.1), rate_rps))
    return motion, [motion.heading_shift_at(at_ms * MS) for at_ms, _ in sorted(yaws)]


def test_a_heading_that_jumps_without_a_turn_was_reset_and_the_nose_stayed() -> None:
    motion, resets = headings((0, 0.0), (20, 0.0), (40, 0.7), (60, 0.7), (80, 0.3))
    assert resets == pytest.approx([0.0, 0.0, 0.7, 0.7, 0.3], abs=1e-4)
    between = motion.attitude_at(30 * MS)
    assert between is not None
    assert between.yaw_rad == pytest.approx(3.0, abs=1e-3), "halfway through a reset is nowhere"
    assert motion.heading_shift_at(30 * MS) == 0.0


@pytest.mark.parametrize("step_ms", [20, 100, 200])
def test_a_turn_that_the_rates_tell_of_is_no_reset(step_ms: int) -> None:
    turn = [(at_ms, 1.5 * at_ms / 1000) for at_ms in range(0, 2001, step_ms)]
    _, resets = headings(*turn, rate_rps=1.5 / (math.cos(0.1) / math.cos(-0.2)))
    assert not any(resets)


def test_a_message_that_comes_late_is_put_on_its_side_of_the_reset() -> None:
    for yaw, expected in ((0.0, [0.0, 0.0, 0.7]), (0.7, [0.0, 0.7, 0.7])):
        _, resets = headings((0, 0.0), (40, 0.7), (20, yaw))
        assert resets == pytest.approx(expected, abs=1e-4)


def test_rates_that_nobody_measured_tell_of_no_reset() -> None:
    _, resets = headings((0, 0.0), (100, 0.5), rate_rps=0.0)
    assert not any(resets)


def test_a_wide_gap_is_not_bridged() -> None:
    motion = history((0, Attitude(0, 0, 0)), (5000, Attitude(0, 0, 1)))
    assert motion.attitude_at(40 * MS) is not None
    assert motion.attitude_at(2500 * MS) is None
    assert motion.attitude_at(4960 * MS) is not None
    assert motion.attitude_at(-60 * MS) is None


def test_late_messages_are_put_where_they_belong_and_repeated_ones_dropped() -> None:
    motion = history(
        (0, Attitude(0, 0, 0)), (40, Attitude(0.4, 0, 0)), (20, Attitude(0.1, 0, 0)), (20, Attitude(9, 0, 0))
    )
    middle = motion.attitude_at(20 * MS)
    assert middle is not None
    assert middle.roll_rad == pytest.approx(0.1)


def test_only_the_last_seconds_are_kept() -> None:
    motion = MotionHistory(MotionLimits())
    for step in range(5000):
        motion.add_attitude(step * 20 * MS, Attitude(0, 0, 0), STILL)
    assert motion.attitude_at(50 * S) is None
    assert motion.attitude_at(97 * S) is not None


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_numbers_that_are_none_are_not_stored(bad: float) -> None:
    motion = MotionHistory(MotionLimits())
    assert not motion.add_attitude(0, Attitude(bad, 0, 0), STILL)
    assert not motion.add_attitude(0, Attitude(0, 0, 0), (0, bad, 0))
    assert not motion.add_position(0, (0, bad, 0), STILL)
    assert motion.attitude_at(0) is None
    assert motion.position_at(0) is None


def test_position_is_interpolated_and_carried_by_its_velocity() -> None:
    motion = MotionHistory(MotionLimits())
    motion.add_position(0, (0.0, 0.0, -5.0), (3.0, 0.0, 0.0))
    motion.add_position(100 * MS, (0.3, 0.0, -5.0), (3.0, 0.0, 1.0))
    middle, ahead = motion.position_at(50 * MS), motion.position_at(140 * MS)
    assert middle is not None
    assert middle[0] == pytest.approx((0.15, 0.0, -5.0))
    assert middle[1] == pytest.approx((3.0, 0.0, 0.5))
    assert ahead is not None
    assert ahead[0] == pytest.approx((0.42, 0.0, -4.96))
    assert motion.position_at(160 * MS) is None


@given(st.floats(-0.7, 0.7), st.floats(-0.7, 0.7), st.floats(0.5, 40))
def test_the_range_is_levelled_to_a_height(roll: float, pitch: float, height_m: float) -> None:
    attitude = Attitude(roll, pitch, 1.0)
    motion = history((0, attitude), (20, attitude))
    down = attitude.ned_from_body @ np.array([0.0, 0.0, 1.0])
    motion.add_range(10 * MS, height_m / down[2])
    found = motion.height_at(15 * MS)
    if down[2] < math.cos(math.radians(45)):
        assert found is None
    else:
        assert found == pytest.approx(height_m, rel=1e-6)


def test_height_is_interpolated_on_one_surface_and_not_between_two() -> None:
    motion = history(*[(at, Attitude(0, 0, 0)) for at in range(0, 400, 20)])
    for at_ms, range_m in ((0, 5.0), (100, 5.2), (200, 12.0)):
        motion.add_range(at_ms * MS, range_m)
    assert motion.height_at(50 * MS) == pytest.approx(5.1)
    assert motion.height_at(120 * MS) == pytest.approx(5.2)
    assert motion.height_at(180 * MS) == pytest.approx(12.0)


def test_height_needs_a_recent_reading_within_range_and_an_attitude() -> None:
    motion = history(*[(at, Attitude(0, 0, 0)) for at in range(0, 2000, 20)])
    motion.add_range(500 * MS, 5.0)
    assert motion.height_at(900 * MS) == pytest.approx(5.0)
    assert motion.height_at(1001 * MS) is None
    motion.add_range(1100 * MS, None)
    assert motion.height_at(1100 * MS) is None
    blind = MotionHistory(MotionLimits())
    blind.add_range(0, 5.0)
    assert blind.height_at(0) is None


def heights(talk: Conversation, flight: Flight, **reading: int) -> float | None:
    """Height after a second of flight in which the reading comes at 20 Hz beside the attitude."""
    for _ in range(20):
        flight.fly(0.04)
        talk.hear(flight.voice.distance(flight.boot_ms(talk.now_ns), **reading))
    flight.fly(0.04)
    return talk.session.telemetry_at(talk.now_ns - 60 * MS, talk.now_ns).height_m


@pytest.mark.parametrize("orientation", [0, 1, 2, 3, 4, 5, 6, 7, 24])
def test_the_echo_of_our_own_obstacles_is_no_height(orientation: int) -> None:
    talk = Conversation(S)
    assert heights(talk, Flight(talk, Voice()), centimetres=700, orientation=orientation) is None


@pytest.mark.parametrize(
    ("centimetres", "quality", "height_m"),
    [
        (700, 0, 7.0),
        (700, 100, 7.0),
        (700, 1, None),
        (0, 0, None),
        (20, 0, None),
        (5000, 0, None),
        (6000, 0, None),
    ],
)
def test_a_reading_out_of_range_or_invalid_is_no_height(
    centimetres: int, quality: int, height_m: float | None
) -> None:
    talk = Conversation(S)
    found = heights(talk, Flight(talk, Voice()), centimetres=centimetres, quality=quality)
    assert found == (pytest.approx(height_m) if height_m is not None else None)


def test_one_downward_sensor_is_kept_to_until_it_is_silent() -> None:
    talk = Conversation(S)
    flight = Flight(talk, Voice())
    assert heights(talk, flight, centimetres=700, sensor_id=2) == pytest.approx(7.0)
    talk.hear(flight.voice.distance(flight.boot_ms(talk.now_ns), 300, sensor_id=5))
    flight.fly(0.04)
    assert talk.session.telemetry_at(talk.now_ns - 20 * MS, talk.now_ns).height_m == pytest.approx(7.0)
    flight.fly(0.6)
    assert heights(talk, flight, centimetres=300, sensor_id=5) == pytest.approx(3.0)


def test_r24_telemetry_survives_the_wrap_of_the_autopilots_clock() -> None:
    talk = Conversation(S)
    flight = Flight(talk, Voice(), offset_ms=2**32 - 3_000)
    flight.yaw_rate = 0.5
    for _ in range(20):
        flight.fly(0.2)
        captured_ns = talk.now_ns - 77 * MS
        telemetry = talk.session.telemetry_at(captured_ns, talk.now_ns)
        assert telemetry.attitude is not None
        assert telemetry.position_ned_m is not None
        expected = 0.5 * (captured_ns / S + flight.offset_ms / 1000)
        assert math.remainder(telemetry.attitude.yaw_rad - expected, math.tau) == pytest.approx(0, abs=0.003)
    assert talk.session.status(talk.now_ns).reboots == 0


def test_the_newest_pose_tells_when_it_held_and_ends_with_the_stream() -> None:
    talk = Conversation(S)
    flight = Flight(talk, Voice())
    assert talk.session.newest_pose(talk.now_ns).attitude is None
    flight.fly(1.0)
    pose = talk.session.newest_pose(talk.now_ns)
    assert pose.attitude is not None
    assert pose.position_ned_m is not None
    assert pose.velocity_ned_mps == pytest.approx((1.0, 0.0, 0.0))
    assert pose.position_ned_m[0] == pytest.approx((pose.at_ns / MS + flight.offset_ms) / 1000, abs=0.01)
    assert 0 <= talk.now_ns - pose.at_ns <= 30 * MS
    talk.wait_s(0.6)
    assert talk.session.newest_pose(talk.now_ns).attitude is None
