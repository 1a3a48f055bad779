"""Half a second of memory: what left the view stays where it stood, and nothing else."""

from __future__ import annotations

import math

import numpy as np
import pytest
from elements import element, obstacles
from hypothesis import given, settings
from hypothesis import strategies as st
from scan_strategies import scan_of, scans, single
from solids import box, depth_of, ground, turned

from uavdepth import ObstacleScanner, ScanError, SectorState
from uavdepth.scan.memory import ScanMemory
from uavdepth.scan.motion import PlanarPose, moved_scan

OBSTACLE, CLEAR, UNKNOWN = SectorState.OBSTACLE, SectorState.CLEAR, SectorState.UNKNOWN
FRAME_NS = 66_666_667
NOTHING = scan_of(np.nan, np.full(72, UNKNOWN))
OPEN = scan_of(np.nan, np.full(72, CLEAR))


def pose(at_ns: int = 0, north: float = 0.0, east: float = 0.0, yaw_deg: float = 0.0) -> PlanarPose:
    return PlanarPose(at_ns, north, east, math.radians(yaw_deg))


def shown(memory: ScanMemory, scan, at_ns: int, **where: float):
    return memory.merge(scan, at_ns, pose(at_ns, **where))


class TestUnknown:
    def test_an_obstacle_that_is_no_longer_seen_stays_for_half_a_second(self):
        memory = ScanMemory()
        shown(memory, single(10, 5.0), 0)
        for at_ns in (100_000_000, 300_000_000, 500_000_000):
            scan = shown(memory, NOTHING, at_ns)
            assert obstacles(scan) == [element(10)]
            assert scan.distance_m[element(10)] == pytest.approx(5.0)
        assert obstacles(shown(memory, NOTHING, 500_000_001)) == []

    def test_nothing_lives_longer_by_being_remembered_again_and_again(self):
        memory = ScanMemory()
        shown(memory, single(10, 5.0), 0)
        last = [number for number in range(1, 40) if obstacles(shown(memory, NOTHING, number * FRAME_NS))][-1]
        assert last * FRAME_NS <= 500_000_000 < (last + 3) * FRAME_NS

    def test_it_is_carried_by_the_turn_and_the_way(self):
        memory = ScanMemory()
        shown(memory, single(0, 8.0), 0)
        scan = shown(memory, NOTHING, 400_000_000, yaw_deg=40)
        assert element(-40) in obstacles(scan)
        assert set(obstacles(scan)) <= {element(-45), element(-40), element(-35)}
        memory.clear()
        shown(memory, single(0, 8.0), 0)
        scan = shown(memory, NOTHING, 400_000_000, north=2.0)
        assert scan.nearest_m == pytest.approx(6.0, abs=0.1)

    def test_a_turn_carries_an_obstacle_into_the_elements_that_hold_much_of_it_and_no_others(self):
        for yaw_deg, told in ((1.5, [0]), (2.5, [-5, 0]), (3.5, [-5]), (5.0, [-5])):
            memory = ScanMemory()
            shown(memory, single(0, 8.0), 0)
            scan = shown(memory, NOTHING, FRAME_NS, yaw_deg=yaw_deg)
            assert obstacles(scan) == [element(bearing) for bearing in told], yaw_deg

    def test_what_the_vehicle_has_come_to_and_not_met_was_not_there(self):
        memory = ScanMemory()
        shown(memory, single(0, 1.0), 0)
        assert obstacles(shown(memory, NOTHING, 400_000_000, north=1.2)) == []

    def test_the_newest_scan_that_knew_counts(self):
        memory = ScanMemory()
        shown(memory, single(0, 5.0), 0)
        shown(memory, OPEN, 300_000_000)
        assert obstacles(shown(memory, NOTHING, 366_666_667)) == []


class TestDropOuts:
    def test_a_wire_that_is_missed_once_stays_and_missed_twice_is_gone(self):
        memory = ScanMemory()
        wire = single(0, 6.0)
        told = [
            obstacles(shown(memory, scan, number * FRAME_NS))
            for number, scan in enumerate([wire, wire, OPEN, OPEN, OPEN])
        ]
        assert told == [[element(0)], [element(0)], [element(0)], [], []]

    def test_a_wire_missed_before_a_wall_stays(self):
        memory = ScanMemory()
        for number in range(2):
            shown(memory, single(0, 4.0), number * FRAME_NS)
        scan = shown(memory, single(0, 12.0), 2 * FRAME_NS)
        assert scan.distance_m[element(0)] == pytest.approx(4.0)

    def test_what_stood_there_for_one_frame_only_is_not_kept_against_a_clear_view(self):
        memory = ScanMemory()
        shown(memory, OPEN, 0)
        shown(memory, single(0, 6.0), FRAME_NS)
        assert obstacles(shown(memory, OPEN, 2 * FRAME_NS)) == []

    def test_a_thing_that_moved_into_the_next_element_is_not_told_twice(self):
        memory = ScanMemory()
        for number in range(2):
            shown(memory, single(0, 6.0), number * FRAME_NS)
        scan = shown(memory, single(5, 6.0), 2 * FRAME_NS)
        assert obstacles(scan) == [element(5)]


class TestTrust:
    @pytest.mark.parametrize(
        ("at_ns", "where"),
        [
            (-1, pose()),
            (0, pose()),
            (FRAME_NS, None),
            (FRAME_NS, pose(north=math.nan)),
            (FRAME_NS, pose(yaw_deg=math.inf)),
            (FRAME_NS, pose(north=-8.0)),
            (FRAME_NS, pose(yaw_deg=120.0)),
        ],
        ids=["time back", "time still", "no pose", "no number", "no yaw", "leap", "spin"],
    )
    def test_memory_is_forgotten_when_the_motion_is_not_known(self, at_ns, where):
        memory = ScanMemory()
        shown(memory, single(0, 5.0), 0)
        assert obstacles(memory.merge(NOTHING, at_ns, where)) == []

    def test_memory_can_be_switched_off_and_not_made_longer(self):
        memory = ScanMemory(0.0)
        shown(memory, single(0, 5.0), 0)
        assert obstacles(shown(memory, NOTHING, FRAME_NS)) == []
        for wrong in (-0.1, 0.51, math.nan):
            with pytest.raises(ScanError, match=str(wrong)):
                ScanMemory(wrong)

    def test_the_scan_itself_is_left_as_it_was(self):
        memory = ScanMemory()
        shown(memory, single(0, 5.0), 0)
        shown(memory, NOTHING, FRAME_NS)
        assert (NOTHING.state == UNKNOWN).all()


def test_r11_a_turn_in_front_of_one_wall_leaves_no_ring(camera, mount, level):
    camera = camera.scaled(160, 80)
    scanner, memory = ObstacleScanner(camera, mount), ScanMemory()
    things = [box((8, -6, -9), (9, 6, 3)), ground(3)]  # north of the vehicle, 12 m wide
    # The wall ends in one element of the scan that saw it, which is carried into at most one more.
    reach = math.degrees(math.atan2(6, 8)) + 7.5
    told = {}
    for yaw in range(0, 420, 6):  # 90 degrees a second at 15 frames a second, once round and on
        depth = depth_of([turned(thing, -yaw) for thing in things], camera, mount, level)
        scan = shown(memory, scanner.scan(depth, level, 3.0), yaw // 6 * FRAME_NS, yaw_deg=yaw)
        told[yaw] = obstacles(scan)
        north = (scan.bearing_deg + yaw + 180) % 360 - 180
        assert (np.abs(north[told[yaw]]) <= reach).all(), yaw
        assert (scan.distance_m[told[yaw]] > 7.5).all(), yaw
    assert len(told[66]) >= 12, "what has left the picture is remembered"
    assert not any(told[yaw] for yaw in range(144, 270, 6)), "and half a second later forgotten"
    assert set(told[0]) <= set(told[360])


motions = st.tuples(st.integers(1, 600_000_000), st.floats(-2, 2), st.floats(-2, 2), st.floats(-60, 60))


@settings(max_examples=40)
@given(st.lists(st.tuples(scans, motions), min_size=1, max_size=6))
def test_memory_adds_obstacles_and_nothing_else(steps):
    memory, at_ns = ScanMemory(), 0
    for scan, (elapsed_ns, north, east, yaw_deg) in steps:
        at_ns += elapsed_ns
        merged = shown(memory, scan, at_ns, north=north, east=east, yaw_deg=yaw_deg)
        changed = merged.state != scan.state
        assert (merged.state[changed] == OBSTACLE).all()
        both = (merged.state == OBSTACLE) & (scan.state == OBSTACLE)
        assert (merged.distance_m[both] <= scan.distance_m[both]).all()
        np.testing.assert_array_equal(np.isnan(merged.distance_m), merged.state != OBSTACLE)
        assert np.nanmin(merged.distance_m, initial=math.inf) >= 0


@settings(max_examples=40)
@given(scans, st.floats(-math.pi, math.pi))
def test_unknown_does_not_become_clear_by_turning(scan, turn_rad):
    moved = moved_scan(scan, turn_rad, (0.0, 0.0))
    for bearing in scan.bearing_deg[moved.state == CLEAR]:
        before = (bearing + math.degrees(turn_rad) + 155) / 5
        touched = {round(before - 0.49) % 72, round(before + 0.49) % 72}
        assert all(scan.state[number] == CLEAR for number in touched)
