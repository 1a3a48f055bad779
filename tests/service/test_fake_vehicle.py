"""The simulated multirotor moves as a body does that can only push along its own axis."""

from __future__ import annotations

import math

import pytest

from service.fake_autopilot.vehicle import GRAVITY_MPS2, Demand, Multirotor


def flown(vehicle: Multirotor, seconds: float, demand: Demand | None) -> Multirotor:
    for _ in range(round(seconds / 0.005)):
        vehicle.step(0.005, demand)
    return vehicle


def hovering(yaw_rad: float = 0.0, drag_per_s: float = 0.0) -> Multirotor:
    vehicle = Multirotor((0.0, 0.0, -10.0), yaw_rad, drag_per_s)
    vehicle.floor_down_m = 0.0
    return vehicle


def test_to_accelerate_north_it_pitches_its_nose_down() -> None:
    vehicle = flown(hovering(), 2.0, Demand(north_mps2=2.0))
    assert vehicle.pitch_rad == pytest.approx(-math.atan2(2.0, GRAVITY_MPS2), abs=0.01)
    assert vehicle.velocity_north_mps > 3.0
    assert vehicle.roll_rad == pytest.approx(0.0, abs=1e-9)


def test_to_accelerate_to_its_right_it_rolls_right() -> None:
    vehicle = flown(hovering(yaw_rad=math.pi / 2), 2.0, Demand(north_mps2=-2.0))
    assert vehicle.roll_rad > 0.15
    assert vehicle.velocity_north_mps < -3.0
    assert abs(vehicle.velocity_east_mps) < 0.05


def test_tilting_takes_time() -> None:
    vehicle = flown(hovering(), 0.05, Demand(north_mps2=3.0))
    assert -0.1 < vehicle.pitch_rad < 0.0


def test_it_never_leans_much_more_than_its_limit() -> None:
    vehicle = hovering()
    steepest = 0.0
    for _ in range(600):
        vehicle.step(0.005, Demand(north_mps2=50.0))
        steepest = min(steepest, vehicle.pitch_rad)
    assert -math.radians(31.0) < steepest < -math.radians(29.0)


def test_drag_brings_it_to_rest_after_speed_over_drag_metres() -> None:
    vehicle = hovering(drag_per_s=0.4)
    vehicle.velocity_north_mps = 6.0
    flown(vehicle, 30.0, Demand())
    assert vehicle.north_m == pytest.approx(6.0 / 0.4, rel=0.01)


def test_without_motors_it_falls_and_stays_on_the_ground() -> None:
    vehicle = flown(hovering(), 1.0, None)
    assert vehicle.velocity_down_mps == pytest.approx(GRAVITY_MPS2, rel=0.01)
    flown(vehicle, 2.0, None)
    assert vehicle.landed
    assert vehicle.position_ned_m[2] == 0.0
    assert vehicle.velocity_ned_mps == (0.0, 0.0, 0.0)


def test_from_the_ground_it_climbs_straight_up() -> None:
    vehicle = flown(Multirotor(), 2.0, Demand(climb_mps2=1.0))
    assert not vehicle.landed
    assert vehicle.position_ned_m[2] < -1.5
    assert vehicle.position_ned_m[:2] == (0.0, 0.0)


def test_yaw_wraps_at_half_a_turn() -> None:
    vehicle = flown(hovering(yaw_rad=3.0), 2.0, Demand(yaw_rate_rps=0.5))
    assert -math.pi <= vehicle.yaw_rad < 0.0


def test_a_long_step_is_the_same_flight_as_many_short_ones() -> None:
    long, short = hovering(), hovering()
    long.step(1.0, Demand(north_mps2=2.0))
    for _ in range(50):
        short.step(0.02, Demand(north_mps2=2.0))
    assert long.position_ned_m == pytest.approx(short.position_ned_m)
