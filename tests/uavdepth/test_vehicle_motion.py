"""The camera's motion between two moments, from what an autopilot says."""

from __future__ import annotations

import math

import numpy as np
import pytest
from moving_camera import LEVEL, straight, told

from uavdepth import Attitude, CameraMount
from uavdepth.motion.vehicle_motion import MotionNoise, VehicleMotion

S = 1_000_000_000


def test_flying_ahead_the_world_comes_nearer_along_the_optical_axis() -> None:
    motion = told(straight((2.0, 0.0, 0.0)), 2.0).between(S // 2, S + S // 2, CameraMount())
    assert motion is not None
    np.testing.assert_allclose(motion.offset_m, (0, 0, -2), atol=1e-6)
    np.testing.assert_allclose(motion.rotation, np.eye(3), atol=1e-9)
    assert motion.sigma_m <= 0.1
    assert motion.baseline_m == pytest.approx(2.0)


def test_the_way_back_is_the_opposite() -> None:
    told_motion = told(straight((1.0, 2.0, -0.5)), 2.0, yaw_rad=lambda t_s: 0.4 * t_s)
    mount = CameraMount(pitch_deg=-10, forward_m=0.2)
    there = told_motion.between(S // 3, S, mount)
    back = told_motion.between(S, S // 3, mount)
    assert there is not None
    assert back is not None
    point = np.array([1.0, 2.0, 8.0])
    moved = there.rotation @ (point + there.offset_m)
    np.testing.assert_allclose(back.rotation @ (moved + back.offset_m), point, atol=1e-9)


def test_a_camera_ahead_of_the_vehicle_swings_when_it_yaws() -> None:
    motion = told(straight((0.0, 0.0, 0.0)), 1.0, yaw_rad=lambda t_s: t_s).between(
        0, S // 2, CameraMount(forward_m=1.0)
    )
    assert motion is not None
    assert motion.baseline_m == pytest.approx(2 * math.sin(0.25), abs=1e-3)


def test_doubt_grows_with_the_gap() -> None:
    history = told(straight((1.0, 0.0, 0.0)), 2.0)
    sigmas = [history.between(0, end, CameraMount()) for end in (S // 10, S // 2, S)]
    values = [each.sigma_m for each in sigmas if each is not None]
    assert len(values) == 3
    assert values[0] < values[1] < values[2]
    assert values[0] == pytest.approx(0.01, rel=0.05)


def test_a_position_that_jumps_is_not_used() -> None:
    history = VehicleMotion()
    for step in range(41):
        t_s = step / 20
        history.add_attitude(round(t_s * S), LEVEL)
        history.add_position(round(t_s * S), (t_s + 7.0 * (t_s > 1), 0.0, 0.0), (1.0, 0.0, 0.0))
    motion = history.between(S // 2, 2 * S, CameraMount())
    assert motion is not None
    assert motion.baseline_m == pytest.approx(1.5)
    assert motion.sigma_m == pytest.approx(0.15)


def test_position_mends_what_velocity_gets_wrong() -> None:
    history = VehicleMotion(MotionNoise(velocity_mps=0.2, position_m=0.02))
    for step in range(41):
        t_s = step / 20
        history.add_attitude(round(t_s * S), LEVEL)
        history.add_position(round(t_s * S), (t_s, 0.0, 0.0), (1.1, 0.0, 0.0))
    motion = history.between(0, 2 * S, CameraMount())
    assert motion is not None
    assert motion.baseline_m == pytest.approx(2.0, abs=0.02)
    assert motion.sigma_m < 0.03


@pytest.mark.parametrize("jump", ["velocity", "attitude", "no velocity", "no attitude"])
def test_nothing_is_said_across_a_reset_or_a_gap(jump: str) -> None:
    history = VehicleMotion()
    for step in range(41):
        t_s, later = step / 20, step > 20
        if not (jump == "no attitude" and 0.6 < t_s < 1.2):
            history.add_attitude(round(t_s * S), Attitude(0, 0, 0.6 * (later and jump == "attitude")))
        if not (jump == "no velocity" and 0.6 < t_s < 1.2):
            north = 3.0 if later and jump == "velocity" else 1.0
            history.add_position(round(t_s * S), (t_s, 0, 0), (north, 0, 0))
    assert history.between(S // 2, 3 * S // 2, CameraMount()) is None
    assert history.between(round(1.3 * S), round(1.9 * S), CameraMount()) is not None
    assert history.knows(round(0.9 * S)) == (jump in ("velocity", "attitude"))


def test_between_messages_and_a_little_beyond_motion_is_known_further_on_it_is_not() -> None:
    history = told(straight((1.0, 0.0, 0.0)), 1.0)
    assert history.knows(round(0.512 * S))
    assert history.knows(round(1.04 * S))
    assert not history.knows(round(1.2 * S))
    assert not history.knows(-1)
    assert history.between(0, round(1.2 * S), CameraMount()) is None


def test_a_step_back_in_time_forgets_and_numbers_that_are_none_are_refused() -> None:
    history = told(straight((1.0, 0.0, 0.0)), 1.0)
    assert not history.add_attitude(2 * S, Attitude(math.nan, 0, 0))
    assert not history.add_position(2 * S, (0, 0, math.inf), (0, 0, 0))
    assert not history.add_position(S, (0, 0, 0), (0, 0, 0))
    assert history.add_attitude(S // 10, LEVEL)
    assert history.between(0, S // 10, CameraMount()) is None


@pytest.mark.parametrize("field", ["attitude_rad", "velocity_mps", "position_m"])
def test_an_autopilot_without_noise_is_refused(field: str) -> None:
    with pytest.raises(ValueError, match=f"{field} is 0"):
        MotionNoise(**{field: 0.0})
