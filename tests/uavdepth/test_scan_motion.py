"""What stood still stays where it is in the world while the vehicle turns and moves."""

from __future__ import annotations

import math

import numpy as np
import pytest
from elements import element, obstacles
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from uavdepth import ObstacleScan, ScanError, SectorState, obstacle_words
from uavdepth.scan.motion import PlanarPose, moved_scan
from uavdepth.scan.obstacle_scan import sector_bearings_deg

FIELD = [element(bearing) for bearing in range(-45, 50, 5)]


def scan_with(found: dict[float, float], clear: list[int] = FIELD) -> ObstacleScan:
    """A scan with obstacles at bearings (degrees: metres), clear in `clear`, unknown else."""
    distance = np.full(72, np.nan, np.float32)
    state = np.full(72, SectorState.UNKNOWN, np.uint8)
    state[clear] = SectorState.CLEAR
    for bearing, metres in found.items():
        distance[element(bearing)], state[element(bearing)] = metres, SectorState.OBSTACLE
    return ObstacleScan(distance, state, sector_bearings_deg(), 0.2, 20.0)


def turned(scan: ObstacleScan, degrees: float) -> ObstacleScan:
    return moved_scan(scan, math.radians(degrees), (0.0, 0.0))


def test_a_vehicle_that_has_not_moved_has_seen_what_it_has_seen() -> None:
    scan = scan_with({-30.0: 4.0, 0.0: 8.0, 5.0: 19.99})
    same = moved_scan(scan, 0.0, (0.0, 0.0))
    np.testing.assert_array_equal(same.state, scan.state)
    np.testing.assert_array_equal(obstacle_words(same), obstacle_words(scan))


def test_an_obstacle_ahead_is_on_the_left_after_a_turn_to_the_right() -> None:
    after = turned(scan_with({0.0: 8.0}), 20.0)
    assert obstacles(after) == [element(-20)]
    assert after.distance_m[element(-20)] == pytest.approx(8.0)


def test_between_two_elements_an_obstacle_is_told_in_both() -> None:
    assert obstacles(turned(scan_with({0.0: 8.0}), 18.0)) == [element(-20), element(-15)]


def test_a_turn_through_the_rear_closes_the_circle() -> None:
    assert obstacles(turned(scan_with({0.0: 8.0}), 180.0)) == [element(180)]
    assert obstacles(turned(scan_with({0.0: 8.0}), -160.0)) == [element(160)]


def test_clear_turns_with_the_vehicle_and_what_comes_into_view_is_unknown() -> None:
    after = turned(scan_with({}), 12.0)
    # -45 to 45 were looked at, out to 47.5 degrees; now that is -59.5 to 35.5.
    assert np.flatnonzero(after.state == SectorState.CLEAR).tolist() == [
        element(bearing) for bearing in range(-55, 35, 5)
    ]


def test_a_direction_that_an_obstacle_reaches_into_is_told_and_none_beside_it_is_lost() -> None:
    after = turned(scan_with({0.0: 8.0}), 2.0)
    assert obstacles(after) == [element(-5), element(0)]
    assert after.state[element(5)] == SectorState.CLEAR
    assert after.state[element(-10)] == SectorState.CLEAR


def test_what_is_ahead_gets_nearer_by_the_way_flown() -> None:
    after = moved_scan(scan_with({0.0: 8.0}), 0.0, (0.6, 0.0))
    assert after.distance_m[element(0)] == pytest.approx(7.4)
    assert after.state[element(20)] == SectorState.CLEAR


def test_what_is_passed_moves_to_the_side() -> None:
    after = moved_scan(scan_with({45.0: 2.0}), 0.0, (1.0, 0.0))
    # It was 1.41 m ahead and as far to the right; 1 m further on it is 74 degrees to the right.
    assert element(75) in obstacles(after)
    assert after.distance_m[element(75)] == pytest.approx(math.hypot(0.414, 1.414), abs=0.06)


def test_a_way_to_the_left_turns_what_is_ahead_to_the_right() -> None:
    assert obstacles(moved_scan(scan_with({0.0: 5.0}), 0.0, (0.0, -0.5)))[-1] > element(0)


def test_an_obstacle_that_the_way_leads_through_stays_ahead_at_nothing() -> None:
    after = moved_scan(scan_with({0.0: 0.5}), math.radians(5.0), (0.8, 0.0))
    assert after.distance_m[element(-5)] == 0.0
    assert obstacle_words(after)[element(-5)] == 21


def test_an_obstacle_that_recedes_beyond_the_reach_is_not_called_clear() -> None:
    after = moved_scan(scan_with({0.0: 19.9}), 0.0, (-1.0, 0.0))
    assert obstacle_words(after)[element(0)] == 1998


@pytest.mark.parametrize("way", [(math.nan, 0.0), (0.0, math.inf)])
def test_a_way_that_is_no_number_is_refused(way: tuple[float, float]) -> None:
    with pytest.raises(ScanError, match="finite"):
        moved_scan(scan_with({}), 0.0, way)


states = hnp.arrays(np.uint8, 72, elements=st.sampled_from([int(state) for state in SectorState]))
metres = hnp.arrays(np.float32, 72, elements=st.floats(0.0, 20.0, width=32))
ways = st.floats(-2.0, 2.0)


@given(states, metres, st.floats(-math.pi, math.pi), ways, ways)
def test_unknown_never_becomes_clear(state, distance, turn, forward, right) -> None:
    distance = np.where(state == SectorState.OBSTACLE, distance, np.float32(np.nan))
    scan = ObstacleScan(distance, state, sector_bearings_deg(), 0.2, 20.0)
    after = moved_scan(scan, turn, (forward, right))
    for bearing in after.bearing_deg[after.state == SectorState.CLEAR] + math.degrees(turn):
        # Followed outwards, each clear direction crosses only what was clear or in front of an obstacle.
        for metres_away in (4.0 * math.hypot(forward, right) + 0.2, 12.0, 20.0):
            at = math.radians(bearing)
            ahead, aside = forward + metres_away * math.cos(at), right + metres_away * math.sin(at)
            crossed = element(math.degrees(math.atan2(aside, ahead)))
            in_front = state[crossed] == SectorState.OBSTACLE and distance[crossed] > math.hypot(ahead, aside)
            assert state[crossed] == SectorState.CLEAR or in_front


@pytest.mark.parametrize("way_m", [3.0, 4.5, 6.0])
def test_unknown_in_the_middle_is_not_passed_over_however_far_the_vehicle_has_flown(way_m: float) -> None:
    field = [element(bearing) for bearing in range(-60, 65, 5)]
    after = moved_scan(scan_with({}, [k for k in field if k != element(25)]), 0.0, (0.0, way_m))
    unseen = math.radians(25.0)
    across, along = 15.0 * math.sin(unseen) - way_m, 15.0 * math.cos(unseen)
    assert after.state[element(math.degrees(math.atan2(across, along)))] == SectorState.UNKNOWN


@given(states, metres, st.floats(-math.pi, math.pi), ways, ways)
def test_no_obstacle_is_lost(state, distance, turn, forward, right) -> None:
    distance = np.where(state == SectorState.OBSTACLE, distance, np.float32(np.nan))
    scan = ObstacleScan(distance, state, sector_bearings_deg(), 0.2, 20.0)
    after = moved_scan(scan, turn, (forward, right))
    for k in np.flatnonzero(state == SectorState.OBSTACLE):
        at = math.radians(float(scan.bearing_deg[k]))
        ahead, aside = distance[k] * math.cos(at) - forward, distance[k] * math.sin(at) - right
        left_m = math.hypot(ahead, aside)
        told = [after.distance_m[element(math.degrees(math.atan2(aside, ahead) - turn))]]
        if left_m < 0.35 or distance[k] <= math.hypot(forward, right):
            told.append(after.distance_m[element(math.degrees(at - turn))])
        assert np.nanmin([*told, np.inf]) <= left_m + 1e-3


@given(st.floats(-50, 50), st.floats(-50, 50), st.floats(-7, 7), st.floats(-50, 50), st.floats(-7, 7))
def test_two_poses_tell_the_turn_and_the_way(north, east, yaw, further, later_yaw) -> None:
    pose = PlanarPose(0, north, east, yaw)
    turn, (ahead, aside) = pose.motion_to(PlanarPose(1, north + further, east - 1.0, later_yaw))
    assert math.cos(turn - (later_yaw - yaw)) == pytest.approx(1.0)
    assert ahead * math.cos(yaw) - aside * math.sin(yaw) == pytest.approx(further, abs=1e-9)
    assert ahead * math.sin(yaw) + aside * math.cos(yaw) == pytest.approx(-1.0, abs=1e-9)
