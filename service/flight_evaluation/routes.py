"""Where the closed loop flies: straight at something, and along free ways."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from service.fake_autopilot.controller import VEHICLE_RADIUS_M
from service.flight_evaluation.configuration import BAND
from uavdepth.scenes import Scene

HEIGHTS_M = (2.5, 5.0)
"""Of the flights above the ground at their start."""

APPROACH_M = (13.0, 20.0)
"""Way to the obstacle: full speed is reached on it, and it is short enough to be flown often."""

CORRIDOR_M = 18.0
"""Way to be flown freely, of which the last is as far from anything ahead as `_BEYOND_M`."""

_BEYOND_M = 13.0
"""At 3 m/s ArduPilot slows down from 9 m on with a margin of 4 m: 4.5 m to brake and the margin."""

_CORRIDOR_HALF_M = (5.0, 4.2)
"""Free on both sides; the second where a world has nothing wider. ArduPilot's forward face is 45 degrees
wide: what stands so far aside is in it from 13 or 11 m on, and it slows down from 9 m on."""

_BODY_HALF_M = 0.3
_SOLID = 0.3
"""Share of the rays over the vehicle's front that must meet the obstacle, all within `_THICK_M`."""

_THICK_M = 2.0
_START_CLEARANCE_M = 1.6
_FRONT_M = 3.0
"""Nothing stands beside an approach but near its end, so that it is this obstacle that is stopped for."""

_BESIDE_M = 2.5
_WAY_CLEARANCE_M = 1.7
_EDGES, _EDGES_M = 4, (3.0, 14.0)
_HAND_M = 0.12
_SIDE_M, _SIDE_HEIGHT_M = 1.2, 0.5
_DEEP_M, _OBLIQUE_M = 0.8, 0.5
_BAND_MARGIN_M, _OVER_GROUND_M = 0.1, 0.35
_TRIES = 6000


@dataclass(frozen=True)
class Route:
    """A straight flight.

    Args:
        north_m, east_m: place of the take-off.
        yaw_rad: heading of nose and way.
        height_m: above the ground at the start.
        length_m: to the obstacle, or free way to be flown.
    """

    north_m: float
    east_m: float
    yaw_rad: float
    height_m: float
    length_m: float


def find_approaches(scene: Scene, seed: int, count: int) -> list[Route]:
    """`count` ways that end at something which the vehicle would hit; fewer where the world has fewer."""
    rng = np.random.default_rng([seed, 0xA44])
    return _find(scene, rng, count, lambda place: _way_to_obstacle(scene, place))


def find_corridors(scene: Scene, seed: int, count: int) -> list[Route]:
    """`count` ways on which nothing stands in the height band for far enough; fewer where there are fewer."""
    routes: list[Route] = []
    for number, half_m in enumerate(_CORRIDOR_HALF_M):
        rng = np.random.default_rng([seed, number, 0xC02])
        routes += _find(scene, rng, count - len(routes), partial(_free_way, scene, half_m))
    return routes


def find_viewpoints(scene: Scene, seed: int, count: int) -> list[Route]:
    """`count` places whose outline ahead has edges: something near with something far beside it."""
    return _find(scene, np.random.default_rng([seed, 0x1EE7]), count, partial(_seen_edges, scene))


def _find(
    scene: Scene, rng: np.random.Generator, count: int, length_m: Callable[[Route], float | None]
) -> list[Route]:
    routes: list[Route] = []
    for _ in range(_TRIES):
        if len(routes) == count:
            break
        reach_m = 0.85 * scene.extent_m
        north_m, east_m = (float(value) for value in rng.uniform(-reach_m, reach_m, 2))
        yaw_rad, height_m = float(rng.uniform(-math.pi, math.pi)), float(rng.uniform(*HEIGHTS_M))
        place = Route(north_m, east_m, yaw_rad, height_m, 0.0)
        length = length_m(place)
        if length is not None and _can_take_off(scene, place):
            routes.append(replace(place, length_m=length))
    return routes


def _way_to_obstacle(scene: Scene, place: Route) -> float | None:
    front = np.linspace(-_BODY_HALF_M, _BODY_HALF_M, 7), np.linspace(-_BODY_HALF_M, _BODY_HALF_M, 31)
    aside, up = np.meshgrid(*front)
    reach = _cast(scene, place, aside.ravel(), up.ravel())
    nearest = float(reach.min())
    if not APPROACH_M[0] <= nearest <= APPROACH_M[1]:
        return None
    met = (reach <= nearest + _THICK_M).reshape(aside.shape)
    # A wire meets few of the rays, but all across the front; bare ground that rises is no obstacle to find.
    is_solid = bool(met.mean() >= _SOLID) or bool(met.any(axis=0).all())
    if not is_solid or not _closes_the_way(scene, place, nearest) or _is_gentle_ground(scene, place, nearest):
        return None
    if _free_m(scene, place, _BESIDE_M) < nearest - _FRONT_M or not _would_hit(scene, place, nearest):
        return None
    return nearest


def _closes_the_way(scene: Scene, place: Route, ahead_m: float) -> bool:
    """Whether it stands across the way, and wide: PX4 slides along what it meets obliquely (measured)."""
    sides, heights = np.array([-_SIDE_M, _SIDE_M]), np.linspace(-_SIDE_HEIGHT_M, _SIDE_HEIGHT_M, 41)
    aside, up = np.meshgrid(sides, heights)
    left_m, right_m = _cast(scene, place, aside.ravel(), up.ravel()).reshape(aside.shape).min(axis=0)
    deep = max(abs(left_m - ahead_m), abs(right_m - ahead_m))
    return bool(deep < _DEEP_M and abs(left_m - right_m) < _OBLIQUE_M)


def _would_hit(scene: Scene, place: Route, ahead_m: float) -> bool:
    """Whether flying on hits something, be it a hand's breadth beside the way or over it."""
    down_m = -scene.ground_height_m(place.north_m, place.east_m) - place.height_m
    cosine, sine = math.cos(place.yaw_rad), math.sin(place.yaw_rad)
    ways = ahead_m + np.arange(0.0, _THICK_M, 0.1)
    nearest = min(
        scene.clearance_m((place.north_m + cosine * way, place.east_m + sine * way, down_m)) for way in ways
    )
    return nearest < VEHICLE_RADIUS_M - _HAND_M


def _free_way(scene: Scene, half_m: float, place: Route) -> float | None:
    if _free_m(scene, place, half_m) < CORRIDOR_M + _BEYOND_M:
        return None
    # A wire along the way meets none of the rays along it.
    down_m = -scene.ground_height_m(place.north_m, place.east_m) - place.height_m
    cosine, sine = math.cos(place.yaw_rad), math.sin(place.yaw_rad)
    for way_m in np.arange(0.0, CORRIDOR_M + _BEYOND_M, 1.0):
        position = (place.north_m + cosine * way_m, place.east_m + sine * way_m, down_m)
        if scene.clearance_m(position) < _WAY_CLEARANCE_M:
            return None
    return CORRIDOR_M


def _seen_edges(scene: Scene, place: Route) -> float | None:
    """Distance of the nearest thing ahead, if the outline has edges enough; None if it has not."""
    down_m = -scene.ground_height_m(place.north_m, place.east_m) - place.height_m
    bearings = place.yaw_rad + np.radians(np.arange(-45.0, 45.1, 2.5))
    reach = np.full(len(bearings), math.inf)
    for up_m in (-1.0, 0.0, 1.0):
        fan = np.stack([np.cos(bearings), np.sin(bearings), 0.0 * bearings], axis=1)
        origin = np.array([place.north_m, place.east_m, down_m - up_m])
        reach = np.minimum(reach, scene.ray_distance_m(origin, fan))
    reach = np.minimum(reach, 20.0)
    edges = np.count_nonzero(np.abs(np.diff(np.log(np.maximum(reach, 0.1)))) > math.log(1.5))
    near_m = float(reach.min())
    return near_m if edges >= _EDGES and _EDGES_M[0] <= near_m <= _EDGES_M[1] else None


def _free_m(scene: Scene, place: Route, half_m: float) -> float:
    """How far a box round the way is free: so wide to each side, and as high as the height band."""
    lowest_m = -min(BAND.below_m + _BAND_MARGIN_M, place.height_m - _OVER_GROUND_M)
    highest_m = BAND.above_m + _BAND_MARGIN_M
    free_m = math.inf
    # Coarsely first; then close enough together for poles, and for wires.
    for across, along in ((9, 5), (round(2 * half_m / 0.03), 5), (5, round((highest_m - lowest_m) / 0.03))):
        aside, up = np.meshgrid(np.linspace(-half_m, half_m, across), np.linspace(lowest_m, highest_m, along))
        free_m = min(free_m, float(_cast(scene, place, aside.ravel(), up.ravel()).min()))
        if free_m < _FRONT_M:
            break
    return free_m


def _cast(
    scene: Scene, place: Route, aside_m: NDArray[np.float64], up_m: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Free way along the heading from points beside, above and below the start."""
    down_m = -scene.ground_height_m(place.north_m, place.east_m) - place.height_m
    cosine, sine = math.cos(place.yaw_rad), math.sin(place.yaw_rad)
    norths, easts = place.north_m - sine * aside_m, place.east_m + cosine * aside_m
    return scene.ray_distance_m(
        np.stack([norths, easts, down_m - up_m], axis=1), np.array([cosine, sine, 0.0])
    )


def _is_gentle_ground(scene: Scene, place: Route, ahead_m: float) -> bool:
    """Whether what is met is the slope of a hill that rises by less than 25 degrees."""
    cosine, sine = math.cos(place.yaw_rad), math.sin(place.yaw_rad)

    def ground_m(way_m: float) -> float:
        return scene.ground_height_m(place.north_m + cosine * way_m, place.east_m + sine * way_m)

    rise_m = ground_m(ahead_m) - ground_m(ahead_m - 2.0)
    met_ground = ground_m(ahead_m) > ground_m(0.0) + place.height_m - 0.5
    return met_ground and rise_m < 2.0 * math.tan(math.radians(25.0))


def _can_take_off(scene: Scene, place: Route) -> bool:
    """Whether the place is bare ground with room to climb."""
    ground_m = scene.ground_height_m(place.north_m, place.east_m)

    def clearance_m(up_m: float) -> float:
        return scene.clearance_m((place.north_m, place.east_m, -ground_m - float(up_m)))

    # First past what is low and near, a kerb or a bench, then well away from everything.
    beside = np.arange(VEHICLE_RADIUS_M + 0.05, _START_CLEARANCE_M + 0.3, 0.1)
    if any(clearance_m(up_m) < VEHICLE_RADIUS_M + 0.01 for up_m in beside):
        return False
    above = np.arange(_START_CLEARANCE_M + 0.3, place.height_m + 0.6, 0.5)
    if any(clearance_m(up_m) < _START_CLEARANCE_M for up_m in above):
        return False
    below = scene.rangefinder_m((place.north_m, place.east_m, -ground_m - place.height_m))
    if below is None or abs(below - place.height_m) > 0.1:
        return False
    around = np.linspace(0.0, 2.0 * math.pi, 8, endpoint=False)
    origin = np.array([place.north_m, place.east_m, -ground_m - 0.6])
    fan = np.stack([np.cos(around), np.sin(around), 0.0 * around], axis=1)
    return bool(np.min(scene.ray_distance_m(origin, fan)) > _START_CLEARANCE_M)
