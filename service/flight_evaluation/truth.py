"""True obstacles round a vehicle by ray casting, with what is certain kept apart from what may be called
either way."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from uavdepth.attitude import Attitude
from uavdepth.camera import CameraModel, CameraMount
from uavdepth.scan.level_ground import GROUND_DEPTH_SHARE, GROUND_SLOPE
from uavdepth.scan.obstacle_scan import SECTOR_COUNT, SECTOR_WIDTH_DEG, sector_bearings_deg
from uavdepth.scan.sloping_ground import FLIGHT_CLEARANCE_M

FARTHEST_M = 30.0
"""Truth reaches so far: a report of 19 m for a thing at 21 m is no false one."""

FAN_STEP_DEG = 1 / 3
_FAN_HALF_DEG = 60.0
_FAN_UP_DEG, _FAN_DOWN_DEG = 40.0, 65.0

SMALLEST_SIZE_M, SMALLEST_AREA_M2 = 0.25, 0.01
"""What must be found, as the scanner promises: a square of 0.25 m at 20 m, and nearer what fills as much of
the picture, but at least 0.01 m2 of it."""

_AT_M = 20.0
_SURE = 2.0
"""An obstacle that must be found shows twice as much: rays and pixels do not fall on the same points."""

_DEPTH_WINDOW = 1.2
_BAND_MARGIN_M = 0.15
_EDGE_DEG = 0.5
_PICTURE_MARGIN_PX = 2.0
_GROUND_SKIN_M = 0.15
"""What lies nearer to the bare ground than this is called ground: meshes follow it that well."""

GENTLE_SLOPE_DEG, STEEP_SLOPE_DEG = 12.0, 20.0
"""Bare ground up to the first must not be reported, beyond the second it must: round the 15 degrees between
them a slope of rough ground may be called either way."""

_GROUND_SLOPE_DEG = 15.0
_LOW_M = 0.6
"""Things lower than this may be lost among the ground, as may what is lower than a share of the height."""

_SLOPE_BASE_M = 0.5


class RayWorld(Protocol):
    """The part of a rendered scene that the truth needs."""

    def ground_heights_m(self, north_m: ArrayLike, east_m: ArrayLike) -> NDArray[np.float64]:
        """Heights of the bare ground in metres, up positive."""

    def ray_distance_m(self, origin_ned_m: Any, direction_ned: Any) -> NDArray[np.float64]:
        """(N,) distance in metres along each ray to the first surface, +inf where it is free."""


@dataclass(frozen=True)
class HeightBand:
    """The band in which things count, from the vehicle's origin."""

    below_m: float
    above_m: float


@dataclass(frozen=True)
class TrueElements:
    """What stands round a vehicle, by the elements of a scan.

    Args:
        certain_m: (72,) nearest distance of an obstacle beyond doubt: in the band, no ground, seen, and
            large enough; NaN where there is none.
        any_m: (72,) nearest distance of anything that may be called an obstacle; +inf where there is none.
        looked_at: (72,) bool, elements that lie whole inside the picture at the flight level.
    """

    certain_m: NDArray[np.float64]
    any_m: NDArray[np.float64]
    looked_at: NDArray[np.bool_]


@dataclass(frozen=True)
class _Sorted:
    chosen: NDArray[np.intp]
    range_m: NDArray[np.float64]
    bearing_deg: NDArray[np.float64]
    possible: NDArray[np.bool_]
    certain: NDArray[np.bool_]


class TruthFinder:
    """Casts rays from the camera and sorts what they meet as the scanner's definition asks.

    A point is an obstacle when it lies in the height band and is not ground; ground is what rises less than
    `GROUND_DEPTH_SHARE` of the height, at least 0.6 m, and slopes of up to 15 degrees as far as they stay
    `FLIGHT_CLEARANCE_M` below the flight level. Rays stand for the
    solid angle between them, so that size is measured as the picture shows it.

    Args:
        camera, mount: as the service has them.
        band: the scanner's height band.
        max_distance_m: the scanner's farthest distance; obstacles beyond are not certain.
    """

    def __init__(
        self, camera: CameraModel, mount: CameraMount, band: HeightBand, max_distance_m: float
    ) -> None:
        self._camera = camera
        self._mount = mount
        self._band = band
        self._max_distance_m = max_distance_m

    def find(
        self,
        world: RayWorld,
        position_ned_m: ArrayLike,
        attitude: Attitude,
        height_m: float,
        depth_m: NDArray[np.float32] | None = None,
    ) -> TrueElements:
        """The elements at one pose.

        Args:
            world: what stands around.
            position_ned_m: (3,) the vehicle's, metres.
            attitude: its attitude.
            height_m: what its rangefinder says, levelled.
            depth_m: (H, W) the picture's exact depth; then what a pixel sees and no ray has met is
                nothing false to report.
        """
        position = np.asarray(position_ned_m, np.float64)
        directions = _fan() @ _heading(attitude.yaw_rad).T
        camera_ned_m = position + attitude.ned_from_body @ self._mount.position_body_m
        reach = world.ray_distance_m(camera_ned_m, directions)
        met = np.isfinite(reach) & (reach < 2.0 * FARTHEST_M)
        points = camera_ned_m + directions[met] * reach[met, None]
        found = self._sort(world, points, position, attitude, height_m)
        certain = self._certain(found, np.flatnonzero(met))
        nearest = _nearest_any(found)
        if depth_m is not None:
            seen = self._pixels_ned(depth_m, camera_ned_m, attitude)
            nearest = np.fmin(nearest, _nearest_any(self._sort(world, seen, position, attitude, height_m)))
        return TrueElements(certain, nearest, self._looked_at(attitude))

    def _sort(
        self,
        world: RayWorld,
        points: NDArray[np.float64],
        position: NDArray[np.float64],
        attitude: Attitude,
        height_m: float,
    ) -> _Sorted:
        offset = points - position
        range_m = np.hypot(offset[:, 0], offset[:, 1])
        down = offset[:, 2]
        band, margin = self._band, _BAND_MARGIN_M
        # Only what lies about the band is worth the ground's height and slope.
        near = (range_m < FARTHEST_M) & (down > -band.above_m - margin) & (down < band.below_m + margin)
        points, range_m, down = points[near], range_m[near], down[near]
        bearing = np.degrees(np.arctan2(offset[near, 1], offset[near, 0]) - attitude.yaw_rad)
        over = -points[:, 2] - world.ground_heights_m(points[:, 0], points[:, 1])
        bare = np.abs(over) < _GROUND_SKIN_M
        slope = np.zeros(len(points))
        slope[bare] = _slope_deg(world, points[bare])
        tolerance = max(_LOW_M, GROUND_DEPTH_SHARE * height_m + 0.1) + GROUND_SLOPE * range_m
        # Whoever calls gentle slopes ground cannot tell where a steep one begins before it rises above them.
        gentle_rise_m = math.tan(math.radians(_GROUND_SLOPE_DEG)) * range_m
        steep = bare & (slope > STEEP_SLOPE_DEG) & (height_m - down > tolerance + gentle_rise_m)
        thing = over > tolerance
        in_the_way = bare & (down < FLIGHT_CLEARANCE_M - 2.0 * margin)
        certain = (
            (thing | steep | in_the_way)
            & (down < height_m - tolerance)
            & (down > -band.above_m + margin)
            & (down < band.below_m - margin)
            & (range_m < self._max_distance_m)
            & self._inside_picture(points - position, attitude)
        )
        possible = ~(bare & (slope <= GENTLE_SLOPE_DEG) & (down > FLIGHT_CLEARANCE_M + margin))
        return _Sorted(np.flatnonzero(near), range_m, _wrapped(bearing), possible, certain)

    def _inside_picture(self, offset_ned: NDArray[np.float64], attitude: Attitude) -> NDArray[np.bool_]:
        """Whether points, as (N, 3) offsets from the vehicle, lie well inside the picture."""
        body = offset_ned @ attitude.ned_from_body - self._mount.position_body_m
        pixels = self._camera.projected(body @ self._mount.body_from_camera)
        low, margin = np.array([0.0, 0.0]), _PICTURE_MARGIN_PX
        high = np.array([self._camera.width - 1.0, self._camera.height - 1.0])
        with np.errstate(invalid="ignore"):
            return np.asarray(((pixels >= low + margin) & (pixels <= high - margin)).all(axis=1))

    def _certain(self, found: _Sorted, rays: NDArray[np.intp]) -> NDArray[np.float64]:
        """(72,) nearest distance at which enough of an obstacle is seen.

        Args:
            found: what the fan's rays have met.
            rays: number in the fan of each of the rays that have met something.
        """
        nearest = np.full(SECTOR_COUNT, np.nan)
        element, aside = _elements(found.bearing_deg)
        coherent = _coherent(rays[found.chosen], np.where(found.certain, found.range_m, np.nan))
        sure = coherent & (np.abs(aside) < SECTOR_WIDTH_DEG / 2 - _EDGE_DEG)
        if not sure.any():
            return nearest
        step = math.radians(FAN_STEP_DEG)
        range_m, element = found.range_m[sure], element[sure]
        # Solid angle that the obstacle must fill, in rays of the fan at the flight level.
        wanted_m2 = np.maximum(SMALLEST_AREA_M2, (SMALLEST_SIZE_M * np.minimum(range_m / _AT_M, 1.0)) ** 2)
        wanted_rays = _SURE * wanted_m2 / np.square(range_m * step)
        most = _SURE * 0.05 * math.radians(SECTOR_WIDTH_DEG) * self._vertical_rad / step**2
        wanted = np.maximum(np.minimum(wanted_rays, most), 6.0)
        for number in np.unique(element):
            own = np.flatnonzero(element == number)
            order = own[np.argsort(range_m[own])]
            ranges = range_m[order]
            support = np.searchsorted(ranges, _DEPTH_WINDOW * ranges, "right") - np.arange(len(ranges))
            enough = np.flatnonzero(support >= wanted[order])
            if enough.size:
                nearest[number] = ranges[enough[0]]
        return nearest

    @property
    def _vertical_rad(self) -> float:
        return 2.0 * math.atan(0.5 * self._camera.height / self._camera.fy)

    def _pixels_ned(
        self, depth_m: NDArray[np.float32], camera_ned_m: NDArray[np.float64], attitude: Attitude
    ) -> NDArray[np.float64]:
        """(N, 3) NED points of the pixels that see something near."""
        near = np.isfinite(depth_m) & (depth_m > 0) & (depth_m < FARTHEST_M)
        rays = self._camera.normalized_rays[near].astype(np.float64)
        turn = attitude.ned_from_body @ self._mount.body_from_camera
        return np.asarray(camera_ned_m + (rays * depth_m[near, None]) @ turn.T)

    def _looked_at(self, attitude: Attitude) -> NDArray[np.bool_]:
        """(72,) elements of which both edges lie inside the picture at the flight level."""
        whole = np.ones(SECTOR_COUNT, np.bool_)
        for side in (-0.5, 0.0, 0.5):
            bearing = np.radians(sector_bearings_deg().astype(np.float64) + side * SECTOR_WIDTH_DEG)
            bearing += attitude.yaw_rad
            level = self._max_distance_m * np.stack(
                [np.cos(bearing), np.sin(bearing), np.zeros_like(bearing)], axis=1
            )
            whole &= self._inside_picture(level, attitude)
        return whole


def _coherent(rays: NDArray[np.intp], range_m: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which rays lie in a square of four that meet the same thing.

    What is thinner than two rays may fall between the picture's pixels, which are nearly as far apart.

    Args:
        rays: (n,) numbers in the fan.
        range_m: (n,) what each has met; NaN for what does not count.
    """
    rows, columns = _fan_shape()
    grid = np.full((rows, columns), np.nan)
    grid.ravel()[rays] = range_m
    squares = np.stack([grid[:-1, :-1], grid[1:, :-1], grid[:-1, 1:], grid[1:, 1:]])
    whole = squares.max(axis=0) < _DEPTH_WINDOW * squares.min(axis=0)
    member = np.zeros((rows, columns), np.bool_)
    for down, right in ((0, 0), (1, 0), (0, 1), (1, 1)):
        member[down : rows - 1 + down, right : columns - 1 + right] |= whole
    return np.asarray(member.ravel()[rays] & ~np.isnan(range_m))


def _nearest_any(found: _Sorted) -> NDArray[np.float64]:
    """(72,) nearest distance of anything, counted in the neighbour too where it lies at the edge."""
    nearest = np.full(SECTOR_COUNT, np.inf)
    for shift in (-_EDGE_DEG, 0.0, _EDGE_DEG):
        element, _ = _elements(found.bearing_deg[found.possible] + shift)
        np.minimum.at(nearest, element, found.range_m[found.possible])
    return nearest


def _elements(bearing_deg: NDArray[np.float64]) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """Element of each bearing, and how far from its centre it lies, degrees."""
    place = (bearing_deg - float(sector_bearings_deg()[0])) / SECTOR_WIDTH_DEG
    element = np.floor(place + 0.5)
    return element.astype(np.intp) % SECTOR_COUNT, (place - element) * SECTOR_WIDTH_DEG


def _slope_deg(world: RayWorld, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N,) slope of the bare ground below or above points, degrees."""
    north, east, base = points[:, 0], points[:, 1], _SLOPE_BASE_M
    along = world.ground_heights_m(north + base, east) - world.ground_heights_m(north - base, east)
    across = world.ground_heights_m(north, east + base) - world.ground_heights_m(north, east - base)
    return np.asarray(np.degrees(np.arctan(np.hypot(along, across) / (2.0 * base))))


def _heading(yaw_rad: float) -> NDArray[np.float64]:
    """(3, 3) turn of the level frame into NED."""
    cosine, sine = math.cos(yaw_rad), math.sin(yaw_rad)
    return np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])


def _fan_shape() -> tuple[int, int]:
    """Rows (one elevation each) and columns (one bearing each) of the fan."""
    return round((_FAN_UP_DEG + _FAN_DOWN_DEG) / FAN_STEP_DEG) + 1, round(
        2 * _FAN_HALF_DEG / FAN_STEP_DEG
    ) + 1


@lru_cache(maxsize=1)
def _fan() -> NDArray[np.float64]:
    """(rows * columns, 3) unit directions in the level frame, `FAN_STEP_DEG` apart."""
    rows, columns = _fan_shape()
    bearings = np.radians(np.linspace(-_FAN_HALF_DEG, _FAN_HALF_DEG, columns))
    downs = np.radians(np.linspace(-_FAN_UP_DEG, _FAN_DOWN_DEG, rows))
    bearing, down = (grid.ravel() for grid in np.meshgrid(bearings, downs))
    return np.stack([np.cos(down) * np.cos(bearing), np.cos(down) * np.sin(bearing), np.sin(down)], axis=1)


def _wrapped(degrees: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray((degrees + 180.0) % 360.0 - 180.0)
