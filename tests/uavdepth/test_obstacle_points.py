"""OBSTACLE_DISTANCE_3D: points that stay where the obstacles are, however the vehicle leans."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from uavdepth import Attitude, ObstacleScan, ScanError, SectorState, obstacle_words
from uavdepth.messages.obstacle_points import encode_obstacle_points, obstacle_points
from uavdepth.scan.obstacle_scan import sector_bearings_deg

BEARINGS = sector_bearings_deg()
LEVEL = Attitude(0.0, 0.0, 0.0)

tilts = st.floats(-0.6, 0.6)
attitudes = st.builds(Attitude, tilts, tilts, st.floats(-3.0, 3.0))
scans = st.builds(
    lambda distance, state: ObstacleScan(distance, state, BEARINGS, 0.2, 20.0),
    hnp.arrays(np.float32, 72, elements=st.floats(width=32)),
    hnp.arrays(np.uint8, 72, elements=st.integers(0, 3)),
)


def scan_with(**distance_by_bearing: float) -> ObstacleScan:
    """`at_m10=3.0` puts an obstacle at -10 degrees."""
    distance, state = np.full(72, np.nan, np.float32), np.full(72, SectorState.CLEAR, np.uint8)
    for name, distance_m in distance_by_bearing.items():
        sector = int(np.flatnonzero(int(name[3:].replace("m", "-")) == BEARINGS)[0])
        distance[sector], state[sector] = distance_m, SectorState.OBSTACLE
    return ObstacleScan(distance, state, BEARINGS, 0.2, 20.0)


def test_level_an_obstacle_lies_at_its_bearing_and_distance() -> None:
    ahead, right = obstacle_points(scan_with(at_0=4.0, at_90=5.0), LEVEL, 72)
    assert ahead == pytest.approx([4.0, 0.0, 0.0])
    assert right == pytest.approx([0.0, 5.0, 0.0], abs=1e-6)


def test_30_degrees_nose_down_an_obstacle_ahead_is_up_in_the_body() -> None:
    """Told in the tilted plane it would be stored 5 m low (measured with OBSTACLE_DISTANCE)."""
    ((x, y, z),) = obstacle_points(scan_with(at_0=10.0), Attitude(0.0, math.radians(-30.0), 1.0), 72)
    assert (x, y, z) == pytest.approx((10.0 * math.cos(math.pi / 6), 0.0, -5.0))


@given(scans, attitudes)
def test_tilted_back_every_obstacle_stands_level_where_the_words_tell_it(
    scan: ObstacleScan, attitude: Attitude
) -> None:
    points = obstacle_points(scan, attitude, 72) @ attitude.level_from_body.T
    words = obstacle_words(scan)
    told = np.flatnonzero(words < 2000)
    assert len(points) == len(told), "no obstacle is lost, none invented"
    assert points[:, 2] == pytest.approx(0.0, abs=1e-6)
    ranges = np.hypot(points[:, 0], points[:, 1])
    assert np.sort(words[told]) / 100.0 == pytest.approx(ranges)
    bearings = np.rad2deg(np.arctan2(points[:, 1], points[:, 0]))
    expected = BEARINGS[np.argsort(words, kind="stable")[: len(told)]]
    assert np.abs((bearings - expected + 180.0) % 360.0 - 180.0) == pytest.approx(0.0, abs=1e-3)


@given(scans, attitudes, st.integers(0, 2**34))
def test_every_message_of_a_scan_is_body_frd_with_one_stamp_and_finite(
    scan: ObstacleScan, attitude: Attitude, boot_ms: int
) -> None:
    messages = encode_obstacle_points(scan, attitude, boot_ms)
    assert {m.time_boot_ms for m in messages} == {boot_ms % 2**32}
    assert {m.frame for m in messages} == {mavlink.MAV_FRAME_BODY_FRD}
    assert {(m.min_distance, m.max_distance) for m in messages} == {(0.2, 20.0)}
    assert np.isfinite([[m.x, m.y, m.z] for m in messages]).all()
    assert 1 <= len(messages) <= 72
    sender = mavlink.MAVLink(None, srcSystem=1, srcComponent=196)
    assert all(m.pack(sender) for m in messages)


def test_without_obstacles_one_point_out_of_range_begins_a_new_picture() -> None:
    (message,) = encode_obstacle_points(scan_with(), LEVEL, 1)
    assert math.hypot(message.x, message.y, message.z) > message.max_distance


def test_the_nearest_are_told_when_not_all_can_be() -> None:
    points = obstacle_points(scan_with(at_m10=9.0, at_0=3.0, at_10=6.0, at_20=0.1), LEVEL, 3)
    assert np.hypot(points[:, 0], points[:, 1]) == pytest.approx([0.21, 3.0, 6.0])


@pytest.mark.parametrize("attitude", [Attitude(math.nan, 0.0, 0.0), Attitude(0.0, math.inf, 0.0)])
def test_an_attitude_that_is_not_finite_is_refused(attitude: Attitude) -> None:
    """A NaN in this message aborts ArduPilot's simulator (measured)."""
    with pytest.raises(ScanError, match="must be finite"):
        encode_obstacle_points(scan_with(at_0=3.0), attitude, 1)
