"""The height above ground, by the rangefinder and by the EKF."""

from __future__ import annotations

import math

import pytest

from service.telemetry import Telemetry
from service.vehicle_height import VehicleHeight

SECOND = 1_000_000_000


def at(
    seconds: float, height_m: float | None, ned_m: tuple[float, float, float] | None = (0.0, 0.0, -10.0)
) -> Telemetry:
    return Telemetry(round(seconds * SECOND), height_m=height_m, position_ned_m=ned_m)


def test_the_rangefinder_is_believed_first() -> None:
    known = VehicleHeight("both", 2.0).at(at(1.0, 4.0))
    assert known is not None
    assert (known.height_m, known.age_s, known.by_rangefinder) == (4.0, 0.0, True)


def test_a_reading_is_held_and_moved_by_the_climb() -> None:
    height = VehicleHeight("rangefinder", 2.0)
    first = height.at(at(1.0, 4.0))
    held = height.at(at(2.5, None, (3.0, 0.0, -11.0)))
    assert held is not None
    assert first is not None
    assert held.height_m == pytest.approx(5.0)
    assert held.age_s == pytest.approx(1.5)
    assert held.relative_sigma > first.relative_sigma
    assert height.at(at(3.1, None)) is None


def test_a_held_reading_is_doubted_with_the_way_flown_since() -> None:
    def sigma_after(north_m: float) -> float:
        height = VehicleHeight("rangefinder", 2.0)
        height.at(at(1.0, 4.0))
        held = height.at(at(2.0, None, (north_m, 0.0, -10.0)))
        assert held is not None
        return held.relative_sigma

    assert sigma_after(0.0) < 0.05
    assert sigma_after(20.0) > 0.25


def test_after_the_rangefinder_the_ekf_goes_on_from_its_last_ground_and_doubts_more_with_the_way() -> None:
    height = VehicleHeight("both", 2.0)
    height.at(at(1.0, 7.0))  # ground 3 m above the place of the start
    near = height.at(at(5.0, None, (5.0, 0.0, -12.0)))
    far = height.at(at(6.0, None, (60.0, 0.0, -12.0)))
    assert near is not None
    assert far is not None
    assert near.height_m == far.height_m == pytest.approx(9.0)
    assert not near.by_rangefinder
    assert near.relative_sigma < 0.1
    assert far.relative_sigma > 0.25


def test_without_any_rangefinder_the_ekf_tells_the_height_above_the_start() -> None:
    known = VehicleHeight("ekf", 2.0).at(at(1.0, 4.0))
    assert known is not None
    assert known.height_m == 10.0
    assert known.relative_sigma == pytest.approx(0.05)
    low = VehicleHeight("ekf", 2.0).at(at(1.0, None, (0.0, 0.0, -1.0)))
    assert low is not None
    assert low.relative_sigma > 0.25


def test_the_ekf_is_not_asked_where_the_rangefinder_alone_counts() -> None:
    assert VehicleHeight("rangefinder", 2.0).at(at(1.0, None)) is None


def test_a_rangefinder_that_says_the_vehicle_stands_is_believed() -> None:
    height = VehicleHeight("both", 2.0)
    assert height.at(at(1.0, 4.0)) is not None
    assert height.at(at(2.0, 0.1)) is None


@pytest.mark.parametrize("height_m", [math.nan, math.inf, -math.inf, -3.0])
@pytest.mark.parametrize("down_m", [math.nan, math.inf, 2.0])
def test_numbers_that_are_no_height_give_none(height_m: float, down_m: float) -> None:
    assert VehicleHeight("both", 2.0).at(at(1.0, height_m, (0.0, 0.0, down_m))) is None


def test_time_that_steps_back_and_a_new_start_forget_the_ground() -> None:
    height = VehicleHeight("both", 2.0)
    height.at(at(10.0, 7.0))
    known = height.at(at(9.0, None))
    assert known is not None
    assert known.height_m == 10.0
    height.at(at(20.0, 7.0))
    height.clear()
    known = height.at(at(20.5, None))
    assert known is not None
    assert known.height_m == 10.0
