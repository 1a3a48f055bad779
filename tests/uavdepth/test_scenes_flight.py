"""Planned flights: smooth, clear of everything, at heights and speeds of a small multirotor, repeatable."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from uavdepth.errors import SceneError
from uavdepth.scenes.flight import GRAVITY_MPS2, TILT_LIMIT_DEG, Flight, Sway, plan_flight
from uavdepth.scenes.path_growth import (
    CLEARANCE_M,
    MAX_ACCELERATION_MPS2,
    MAX_HEIGHT_M,
    MAX_SPEED_MPS,
    MIN_HEIGHT_M,
    STEP_S,
)

DURATION_S = 10.0
TIMES_S = np.arange(0.0, DURATION_S + 1e-9, 0.05)
SEEDS = range(12)


class Balls:
    """A world of floating balls over flat ground, solved exactly."""

    extent_m = 60.0

    def __init__(self, count: int = 150, largest_m: float = 3.0) -> None:
        rng = np.random.default_rng(5)
        self.centres = np.column_stack([rng.uniform(-60, 60, (count, 2)), -rng.uniform(0, 12, count)])
        self.radii = rng.uniform(0.5, largest_m, count)

    def ground_height_m(self, north_m: float, east_m: float) -> float:
        return 0.0

    def clearance_m(self, position_ned_m: Sequence[float]) -> float:
        nearest = np.min(np.linalg.norm(self.centres - position_ned_m, axis=1) - self.radii)
        return float(max(min(-position_ned_m[2], nearest), 0.0))

    def ray_distance_m(self, origin_ned_m: ArrayLike, direction_ned: ArrayLike) -> NDArray[np.float64]:
        origin = np.atleast_2d(np.asarray(origin_ned_m, float))
        aim = np.atleast_2d(np.asarray(direction_ned, float))
        aim = aim / np.linalg.norm(aim, axis=1, keepdims=True)
        away = origin[:, None] - self.centres
        along = (away * aim[:, None]).sum(axis=-1)
        root = along**2 - ((away**2).sum(axis=-1) - self.radii**2)
        entry = np.where(root > 0, -along - np.sqrt(np.maximum(root, 0)), np.inf)
        ball = np.where(entry > 0, entry, np.inf).min(axis=1)
        falls = aim[:, 2] > 1e-9
        return np.minimum(ball, np.where(falls, -origin[:, 2] / np.where(falls, aim[:, 2], 1.0), np.inf))


@pytest.fixture(scope="module")
def world() -> Balls:
    return Balls()


@pytest.fixture(scope="module", params=SEEDS)
def flight(world: Balls, request: pytest.FixtureRequest) -> Flight:
    return plan_flight(world, request.param, DURATION_S)


def _positions(flight: Flight) -> NDArray[np.float64]:
    return np.array([flight.at(t).position_ned_m for t in TIMES_S])


def _velocities(flight: Flight) -> NDArray[np.float64]:
    return np.array([flight.at(t).velocity_ned_mps for t in TIMES_S])


def test_a_flight_keeps_clear_of_everything(world: Balls, flight: Flight) -> None:
    assert min(world.clearance_m(p) for p in _positions(flight)) >= CLEARANCE_M


def test_a_flight_stays_between_the_lowest_and_highest_height(flight: Flight) -> None:
    height = -_positions(flight)[:, 2]
    assert height.min() >= MIN_HEIGHT_M
    assert height.max() <= MAX_HEIGHT_M


def test_a_flight_moves_at_the_speeds_of_a_small_multirotor(flight: Flight) -> None:
    speed = np.linalg.norm(_velocities(flight), axis=1)
    assert speed.max() <= MAX_SPEED_MPS
    assert np.median(speed) >= 1.0


def test_velocity_is_the_derivative_of_position(flight: Flight) -> None:
    steps = np.diff(_positions(flight), axis=0) / 0.05
    velocity = _velocities(flight)
    assert np.abs(steps - (velocity[1:] + velocity[:-1]) / 2).max() < 0.01


def test_acceleration_is_bounded_and_has_no_jumps(flight: Flight) -> None:
    acceleration = np.diff(_velocities(flight), axis=0) / 0.05
    assert np.linalg.norm(acceleration, axis=1).max() <= MAX_ACCELERATION_MPS2 + 0.01
    # Between two control points the acceleration changes linearly by at most twice its bound.
    assert (
        np.linalg.norm(np.diff(acceleration, axis=0), axis=1).max()
        <= 2 * MAX_ACCELERATION_MPS2 * 0.05 / STEP_S + 0.01
    )


def test_tilt_is_bounded_and_attitude_is_smooth(flight: Flight) -> None:
    attitudes = [flight.at(t).attitude for t in TIMES_S]
    tilt = [math.degrees(math.acos(a.ned_from_body[2, 2])) for a in attitudes]
    assert max(tilt) <= TILT_LIMIT_DEG + 0.1
    for before, after in pairwise(attitudes):
        turned = before.ned_from_body.T @ after.ned_from_body
        angle = math.degrees(math.acos(min(1.0, (np.trace(turned) - 1) / 2)))
        assert angle < 140.0 * 0.05


def test_the_nose_looks_mostly_where_the_vehicle_goes(world: Balls) -> None:
    off = []
    for seed in SEEDS:
        planned = plan_flight(world, seed, DURATION_S)
        for t in TIMES_S[::10]:
            pose = planned.at(t)
            course = math.atan2(pose.velocity_ned_mps[1], pose.velocity_ned_mps[0])
            off.append(abs(math.remainder(pose.attitude.yaw_rad - course, 2 * math.pi)))
    assert math.degrees(np.median(off)) < 30.0
    assert math.degrees(max(off)) > 10.0, "it also looks around"


def test_heights_change_during_flights_and_most_flights_are_low(world: Balls) -> None:
    heights = [-_positions(plan_flight(world, seed, DURATION_S))[:, 2] for seed in range(24)]
    assert np.median([np.ptp(h) for h in heights]) > 0.5
    assert np.mean([np.median(h) < 10.0 for h in heights]) > 0.5


def test_the_same_seed_gives_the_same_flight_and_another_seed_another(world: Balls) -> None:
    first, again, other = (_positions(plan_flight(world, seed, DURATION_S)) for seed in (3, 3, 4))
    np.testing.assert_array_equal(first, again)
    assert np.abs(first - other).max() > 1.0


def test_a_vehicle_that_accelerates_north_leans_its_thrust_north() -> None:
    t = np.arange(8) * STEP_S
    north = 0.5 * 2.0 * (t - STEP_S) ** 2
    still = Sway(np.zeros((2, 1)), np.ones((2, 1)), np.zeros((2, 1)))
    flight = Flight(2.0, np.column_stack([north, 0 * t, -5 + 0 * t]), np.zeros(8), still)
    attitude = flight.at(0.0).attitude
    assert attitude.pitch_rad == pytest.approx(-math.atan(2.0 / GRAVITY_MPS2), abs=0.01)
    assert attitude.roll_rad == pytest.approx(0.0, abs=1e-9)
    sideways = Flight(2.0, flight.control_ned_m, np.full(8, -math.pi / 2), still).at(0.0).attitude
    assert sideways.roll_rad == pytest.approx(math.atan(2.0 / GRAVITY_MPS2), abs=0.01)


def test_the_vehicle_hangs_still_before_the_start_and_after_the_end(world: Balls) -> None:
    planned = plan_flight(world, 1, DURATION_S)
    before, after = planned.at(-1.0), planned.at(DURATION_S + 1.0)
    np.testing.assert_array_equal(before.position_ned_m, planned.at(0.0).position_ned_m)
    np.testing.assert_array_equal(after.position_ned_m, planned.at(DURATION_S).position_ned_m)
    assert not before.velocity_ned_mps.any()
    assert not after.velocity_ned_mps.any()


@pytest.mark.parametrize("duration_s", [0.0, -1.0, math.nan, math.inf])
def test_an_impossible_duration_is_named(world: Balls, duration_s: float) -> None:
    with pytest.raises(SceneError, match="3600"):
        plan_flight(world, 0, duration_s)


class Crevice(Balls):
    """A world whose walls are 0.5 m away wherever one is."""

    def clearance_m(self, position_ned_m: Sequence[float]) -> float:
        return 0.5


def test_a_world_without_room_is_an_error_and_no_endless_search() -> None:
    with pytest.raises(SceneError, match="no clear path"):
        plan_flight(Crevice(), 0, 5.0)
