"""What the flight evaluation holds to be true, and how it judges a scan by it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("embreex", reason="rendered worlds need the extra sim")
from flight_worlds import SMALL, WALL_AHEAD, world_with

from service.demo.plan import ABOVE_M, BELOW_M
from service.flight_evaluation.configuration import BAND
from service.flight_evaluation.judgement import judge, together
from service.flight_evaluation.sight import Camera, DepthKind
from service.flight_evaluation.truth import HeightBand, TrueElements, TruthFinder
from service.pipeline import make_scanner
from uavdepth.attitude import Attitude
from uavdepth.scan.obstacle_scan import ObstacleScan, SectorState, sector_bearings_deg
from uavdepth.scenes import Scene

LEVEL = Attitude(0.0, 0.0, 0.0)
HEIGHT_M = 3.0
HERE = np.array([0.0, 0.0, -HEIGHT_M])


def element(bearing_deg: float) -> int:
    return int(np.argmin(np.abs(sector_bearings_deg() - bearing_deg)))


def truth_in(world: Scene, attitude: Attitude = LEVEL, band: HeightBand = BAND) -> TrueElements:
    finder = TruthFinder(SMALL.camera.model, SMALL.mount.mount, band, SMALL.scan.max_distance_m)
    return finder.find(world, HERE, attitude, HEIGHT_M)


def scan_in(world: Scene, attitude: Attitude = LEVEL) -> ObstacleScan:
    """The service's own scanner on exact depth."""
    camera = Camera(world, SMALL.camera.model, SMALL.mount.mount, DepthKind.TRUE)
    return make_scanner(SMALL).scan(camera.look(HERE, attitude).depth_m, attitude, HEIGHT_M)


def with_state(scan: ObstacleScan, which: np.ndarray, state: SectorState, distance_m: float) -> ObstacleScan:
    """The scan with other elements."""
    states, distances = scan.state.copy(), scan.distance_m.copy()
    states[which], distances[which] = state, distance_m
    return replace(scan, state=states, distance_m=distances)


@pytest.fixture(scope="module")
def wall() -> Scene:
    return world_with(WALL_AHEAD)


class TestTruth:
    def test_a_wall_stands_at_its_distance_in_every_direction(self, wall: Scene) -> None:
        truth = truth_in(wall)
        for bearing_deg in (-20, -10, 0, 10, 20):
            nearest_deg = max(abs(bearing_deg) - 2.5, 0.0)
            expected = 16.0 / math.cos(math.radians(nearest_deg))
            assert truth.certain_m[element(bearing_deg)] == pytest.approx(expected, rel=0.02)

    def test_flat_ground_is_no_obstacle_however_the_vehicle_leans(self) -> None:
        world = world_with()
        for roll_deg, pitch_deg in ((0, 0), (20, 0), (0, -25), (-15, 15)):
            truth = truth_in(world, Attitude(math.radians(roll_deg), math.radians(pitch_deg), 0.3))
            assert np.isnan(truth.certain_m).all()
            assert np.isinf(truth.any_m).all()

    def test_what_stands_below_the_height_band_does_not_count(self) -> None:
        low = world_with((8.0, 0.0, 1.0, 6.0, 0.4))
        assert np.isnan(truth_in(low).certain_m).all()
        assert np.isinf(truth_in(low).any_m).all()

    def test_a_box_that_reaches_into_the_band_counts(self) -> None:
        high = world_with((8.5, 0.0, 1.0, 6.0, 2.0))
        assert truth_in(high).certain_m[element(0)] == pytest.approx(8.0, rel=0.02)

    def test_what_lies_outside_the_picture_is_not_certain(self) -> None:
        beside = world_with((0.0, 8.0, 4.0, 4.0, 6.0))
        truth = truth_in(beside)
        assert np.isnan(truth.certain_m[truth.looked_at]).all()
        assert not truth.looked_at[element(90)]

    def test_turning_the_vehicle_turns_the_elements(self, wall: Scene) -> None:
        pole = world_with((10.0, 0.0, 0.4, 0.4, 6.0))
        truth = truth_in(pole, Attitude(0.0, 0.0, math.radians(20.0)))
        assert truth.certain_m[element(-20)] == pytest.approx(9.8, rel=0.02)

    def test_the_band_is_the_demos(self) -> None:
        assert HeightBand(BELOW_M, ABOVE_M) == BAND


class TestJudgement:
    @pytest.mark.parametrize("attitude", [LEVEL, Attitude(0.1, -0.15, 0.4)], ids=["level", "leaning"])
    def test_the_scanner_on_exact_depth_misses_nothing_and_invents_nothing(
        self, wall: Scene, attitude: Attitude
    ) -> None:
        tally = judge(truth_in(wall, attitude), scan_in(wall, attitude))
        assert tally.measured >= 10
        assert (tally.missed, tally.unknown, tally.false) == (0, 0, 0)
        assert tally.nearest_error_median is not None
        assert tally.nearest_error_median < 0.05

    @pytest.mark.parametrize(
        ("state", "distance_m", "missed", "false", "unknown"),
        [
            (SectorState.CLEAR, math.nan, 1, 0, 0),
            (SectorState.OBSTACLE, 19.9, 0, 0, 0),
            (SectorState.OBSTACLE, 25.0, 1, 0, 0),
            (SectorState.OBSTACLE, 5.0, 0, 1, 0),
            (SectorState.UNKNOWN, math.nan, 0, 0, 1),
        ],
        ids=[
            "clear is missed",
            "a little far is told",
            "far is missed",
            "near is false",
            "unknown is unknown",
        ],
    )
    def test_one_wrong_element_is_counted_as_what_it_is(
        self, wall: Scene, state: SectorState, distance_m: float, missed: int, false: int, unknown: int
    ) -> None:
        wrong = with_state(scan_in(wall), np.array([element(0)]), state, distance_m)
        tally = judge(truth_in(wall), wrong)
        assert (tally.missed, tally.false, tally.unknown) == (missed, false, unknown)

    def test_an_obstacle_told_where_nothing_stands_is_false(self) -> None:
        empty = world_with()
        ghost = with_state(scan_in(empty), np.array([element(5)]), SectorState.OBSTACLE, 6.0)
        tally = judge(truth_in(empty), ghost)
        assert (tally.measured, tally.false) == (0, 1)
        assert tally.false_rate == pytest.approx(1 / tally.looked_at)

    def test_pictures_add_up(self, wall: Scene) -> None:
        tally = judge(truth_in(wall), scan_in(wall))
        both = together([tally, tally])
        assert both.measured == 2 * tally.measured
        assert both.relative_errors.size == 2 * tally.relative_errors.size
        assert both.nearest_error_median == tally.nearest_error_median

    def test_a_blind_scan_has_no_nearest_obstacle(self, wall: Scene) -> None:
        everything = np.ones(72, np.bool_)
        tally = judge(truth_in(wall), with_state(scan_in(wall), everything, SectorState.CLEAR, math.nan))
        assert tally.missed_rate == 1.0
        assert tally.nearest_error_median == math.inf
