"""Nearest obstacles: a pole that is reported right, too near, too far, not at all, or where none stands."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from training.evaluation_obstacles import (
    FALSE_ALARM_M,
    MEASURED_M,
    SCAN_RANGE_M,
    TOO_FAR,
    ElementErrors,
    all_elements,
    compare_scans,
)
from uavdepth.attitude import Attitude
from uavdepth.camera import CameraModel, CameraMount
from uavdepth.scan.obstacle_scan import SECTOR_COUNT, ObstacleScan, SectorState, sector_bearings_deg
from uavdepth.scan.scanner import ObstacleScanner

CAMERA = CameraModel.from_fov(320, 192, 80.0)
LEVEL = Attitude(0.0, 0.0, 0.0)
SCANNER = ObstacleScanner(CAMERA, CameraMount(), max_distance_m=SCAN_RANGE_M)


def world(pole_m: float | None, bearing_deg: float = 10.0) -> NDArray[np.float32]:
    """Nothing but a pole of 2 degrees: z-depth, +inf everywhere else."""
    depth = np.full((CAMERA.height, CAMERA.width), np.inf, np.float32)
    if pole_m is not None:
        bearing = np.degrees(np.arctan(CAMERA.normalized_rays[..., 0]))
        pole = np.abs(bearing - bearing_deg) < 1.0
        depth[pole] = pole_m * math.cos(math.radians(bearing_deg))
    return depth


def compare(truth: NDArray[np.float32], reported: NDArray[np.float32]) -> ElementErrors:
    return compare_scans(SCANNER.scan(truth, LEVEL), SCANNER.scan(reported, LEVEL))


def test_a_pole_where_it_stands_is_measured_without_error() -> None:
    found = compare(world(8.0), world(8.0))
    assert found.measured == 1
    assert found.missed_share == found.unknown_share == found.false_alarm_share == 0.0
    assert found.median_error == 0.0
    assert found.free > 10


@pytest.mark.parametrize(("said_m", "error"), [(7.2, 0.1), (8.8, 0.1), (4.0, 0.5), (11.6, 0.45)])
def test_a_pole_at_another_distance_is_an_error_but_not_a_miss(said_m: float, error: float) -> None:
    found = compare(world(8.0), world(said_m))
    assert found.missed_share == 0.0
    assert found.median_error == pytest.approx(error, abs=0.02)


def test_a_pole_more_than_half_as_far_again_is_missed() -> None:
    found = compare(world(8.0), world(12.6))
    assert (found.missed_far, found.missed_clear) == (1, 0)
    assert found.missed_share == 1.0
    assert found.median_error == pytest.approx(0.575, abs=0.02)


def test_a_pole_that_is_not_seen_at_all_is_missed_as_clear() -> None:
    found = compare(world(8.0), world(None))
    assert (found.missed_far, found.missed_clear) == (0, 1)
    assert found.median_error is None, "no distance was reported"


def test_a_pole_at_the_end_of_the_span_may_be_said_to_be_beyond_it() -> None:
    assert compare(world(19.0), world(21.0)).missed_share == 0.0


def test_a_pole_of_unknown_depth_is_unknown_and_not_missed() -> None:
    unknown = world(None)
    unknown[np.isfinite(world(8.0, 10.0))] = np.nan
    found = compare(world(8.0), unknown)
    assert found.missed_share == 0.0
    assert found.unknown_share == 1.0


def test_a_pole_in_the_next_element_is_missed_here_but_the_vehicle_was_warned_beside() -> None:
    found = compare(world(8.0, 10.0), world(8.0, 15.0))
    assert found.missed_clear == 1
    assert found.alone == 0
    assert found.alone_share == 0.0
    assert compare(world(8.0, 10.0), world(8.0, 25.0)).alone == 1


def test_a_pole_where_nothing_stands_is_a_false_alarm_only_when_it_is_near() -> None:
    near = compare(world(None), world(FALSE_ALARM_M - 1.0))
    assert near.false_alarms == 1
    assert near.measured == 0
    assert near.missed_share is None, "nothing was there to be missed"
    assert compare(world(None), world(FALSE_ALARM_M + 1.0)).false_alarms == 0


@pytest.mark.parametrize("distance_m", [MEASURED_M[0] - 0.5, MEASURED_M[1] + 1.0])
def test_what_is_nearer_or_farther_than_the_span_is_not_measured(distance_m: float) -> None:
    assert compare(world(distance_m), world(distance_m)).measured == 0


def test_elements_of_many_pictures_count_together() -> None:
    pictures = [compare(world(8.0), world(8.8)), compare(world(8.0), world(None))]
    together = all_elements(pictures)
    assert together is not None
    assert together.measured == 2
    assert together.missed_share == 0.5
    assert together.median_error == pytest.approx(0.1, abs=0.02)
    assert all_elements([]) is None


elements = st.one_of(st.none(), st.just(math.nan), st.floats(0.5, SCAN_RANGE_M, width=32))
some_elements = st.lists(elements, min_size=6, max_size=6)


@given(some_elements, some_elements)
def test_every_measured_element_is_reported_unknown_or_missed_as_clear(
    truth: list[float | None], reported: list[float | None]
) -> None:
    found = compare_scans(made_scan(truth), made_scan(reported))
    assert found.missed_clear + found.relative_errors.size + found.unknown == found.measured
    assert found.missed_far <= np.count_nonzero(found.relative_errors > np.float32(TOO_FAR - 1.0))
    assert found.alone <= found.missed_clear + found.missed_far
    assert found.false_alarms <= found.free
    assert found.measured + found.free <= SECTOR_COUNT


def made_scan(distances_m: list[float | None]) -> ObstacleScan:
    """The first elements as given, the others unknown; None is clear, NaN unknown, a number an obstacle."""
    values = np.full(SECTOR_COUNT, np.nan, np.float32)
    state = np.full(SECTOR_COUNT, SectorState.UNKNOWN, np.uint8)
    for index, distance_m in enumerate(distances_m):
        if distance_m is None:
            state[index] = SectorState.CLEAR
        elif not math.isnan(distance_m):
            values[index], state[index] = distance_m, SectorState.OBSTACLE
    return ObstacleScan(values, state, sector_bearings_deg(), 0.2, SCAN_RANGE_M)
