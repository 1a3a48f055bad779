"""The flight evaluation's closed loop: the service and both fake autopilots in stepped time."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("embreex", reason="rendered worlds need the extra sim")
from flight_worlds import NORTH, SMALL, WALL_AHEAD, world_with

from service.fake_autopilot.autopilot import Flavor
from service.fake_autopilot.obstacle_words import ObstacleWords
from service.flight_evaluation.closed_loop import Flown, Outcome, fly_route
from service.flight_evaluation.routes import find_approaches, find_corridors
from service.flight_evaluation.sight import DepthKind, Eyes
from service.flight_evaluation.turning import outline_turn_deg
from uavdepth.scenes import Scene

LATENCY_S = 0.1


@pytest.fixture(scope="module")
def wall() -> Scene:
    return world_with(WALL_AHEAD)


def fly(world: Scene, flavor: Flavor, *, seeing: bool = True, corridor: bool = False) -> Flown:
    eyes = Eyes(SMALL, DepthKind.TRUE) if seeing else None
    return fly_route(world, SMALL, flavor, eyes, NORTH, LATENCY_S, corridor=corridor)


@pytest.fixture(scope="module")
def seen(wall: Scene) -> dict[Flavor, Flown]:
    """What comes of an approach with exact depth."""
    return {"ardupilot": fly(wall, "ardupilot"), "px4": fly(wall, "px4")}


class TestApproach:
    @pytest.mark.parametrize("flavor", ["ardupilot", "px4"])
    def test_with_exact_depth_it_stops_before_the_wall(
        self, seen: dict[Flavor, Flown], flavor: Flavor
    ) -> None:
        flown = seen[flavor]
        assert flown.outcome is Outcome.STOPPED
        assert flown.way_m > 6.0
        assert flown.ahead_m is not None
        assert 2.5 < flown.ahead_m < 8.0
        assert flown.silent_frames == 0

    @pytest.mark.parametrize("flavor", ["ardupilot", "px4"])
    def test_blind_it_touches(self, wall: Scene, flavor: Flavor) -> None:
        flown = fly(wall, flavor, seeing=False)
        assert flown.outcome is Outcome.TOUCHED
        assert flown.way_m == pytest.approx(NORTH.length_m, abs=0.8)

    def test_two_flights_are_the_same_to_the_bit(self, wall: Scene, seen: dict[Flavor, Flown]) -> None:
        assert fly(wall, "ardupilot") == seen["ardupilot"]


class TestCorridor:
    def test_a_free_way_is_flown_without_a_stop(self) -> None:
        flown = fly(world_with((5.0, 20.0, 10.0, 4.0, 6.0)), "ardupilot", corridor=True)
        assert flown.outcome is Outcome.PASSED

    def test_a_way_that_is_not_free_is_not_passed(self, wall: Scene) -> None:
        assert fly(wall, "px4", corridor=True).outcome is Outcome.STOPPED


class TestRoutes:
    def test_an_approach_ends_at_what_the_vehicle_would_hit(self) -> None:
        world = world_with((0.0, 0.0, 6.0, 6.0, 8.0))
        routes = find_approaches(world, 3, 2)
        assert len(routes) == 2
        for route in routes:
            heading = np.array([np.cos(route.yaw_rad), np.sin(route.yaw_rad), 0.0])
            origin = np.array([route.north_m, route.east_m, -route.height_m])
            assert world.ray_distance_m(origin, heading)[0] == pytest.approx(route.length_m, abs=2.0)

    def test_open_ground_has_corridors_and_no_approaches(self) -> None:
        open_ground = world_with()
        assert find_approaches(open_ground, 3, 1) == []
        assert len(find_corridors(open_ground, 3, 2)) == 2

    def test_nobody_takes_off_beside_a_kerb(self) -> None:
        """It would touch it on the way up; higher up there is room, and past it the way is free."""
        kerbs = [(0.0, east_m, 80.0, 0.3, 0.3) for east_m in np.arange(-40.0, 40.0, 0.8)]
        assert find_corridors(world_with(*kerbs), 3, 1) == []


class TestTurning:
    @pytest.mark.parametrize("turned_deg", [0, 10, -10])
    def test_an_outline_that_is_turned_is_found_so(self, turned_deg: int) -> None:
        world = world_with((9.0, -4.0, 1.0, 3.0, 6.0), (12.0, 4.0, 1.0, 2.5, 6.0))
        words = [65535] * 72
        for bearing_deg in range(-45, 50, 5):
            rays = np.radians(np.arange(bearing_deg - 2.5, bearing_deg + 2.6, 0.5) - turned_deg)
            aim = np.stack([np.cos(rays), np.sin(rays), 0.0 * rays], axis=1)
            nearest_m = float(world.ray_distance_m(np.array([0.0, 0.0, -3.0]), aim).min())
            words[(bearing_deg + 155) // 5] = int(min(100 * nearest_m, 2001))
        error = outline_turn_deg(world, ObstacleWords(words), (0.0, 0.0, -3.0), 0.0)
        assert error == pytest.approx(turned_deg, abs=1.5)
