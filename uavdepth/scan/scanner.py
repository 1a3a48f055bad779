"""From depth to obstacles: 72 directions round the nose, each an obstacle, clear or unknown."""

from __future__ import annotations

import math
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from uavdepth.attitude import Attitude
from uavdepth.camera import CameraModel, CameraMount
from uavdepth.errors import ImageSizeError, ScanError
from uavdepth.scan.band_view import BandView, seen_sectors
from uavdepth.scan.body_rays import body_rays
from uavdepth.scan.caution import ScanCaution
from uavdepth.scan.joined_rows import mean_of_rows, nearest_of_rows, rows_together
from uavdepth.scan.level_ground import GROUND_DEPTH_SHARE, LevelGround, find_level_ground
from uavdepth.scan.level_points import level_points, near_heights
from uavdepth.scan.obstacle_scan import ObstacleScan, SectorState, sector_bearings_deg
from uavdepth.scan.range_histogram import RangeHistogram
from uavdepth.scan.required_pixels import pixels_of_line, pixels_of_thing, smallest_thing
from uavdepth.scan.sloping_ground import GroundProfile, SlopingGround
from uavdepth.scan.speckles import SpeckleFilter

FREE_SHARE = 0.7
"""Share of the band's height that must be seen free before an element is clear. The flight level
itself is then always among what is seen: of the default band it lies at 43 % from the top."""

_LAST_SHARE = 0.999
"""Of maximum distance: the farthest that an obstacle is told at."""

_GROUND_STRIDE = 4
_SLOPE_ROWS, _SLOPE_COLUMNS = 2, 8
_CHUNK = 32768
"""Points worked on at a time, so that the intermediate arrays stay in the processor's cache."""

_Ground = tuple[LevelGround | None, GroundProfile | None]
"""What is ground at any slope: the level below the vehicle, and what is seen to rise from there."""

_Pixel = TypeVar("_Pixel", np.float32, np.bool_)


class ObstacleScanner:
    """Turns depth maps of one camera into scans.

    Points are turned level by roll and pitch (not yaw: bearings stay with the nose), measured from
    the vehicle's origin, and sorted into elements of 5 degrees by their bearing. A point is an
    obstacle when it lies in the height band and is not ground.

    A scanner keeps working memory: use one for each thread.

    An element is
    - OBSTACLE where enough points support a distance (see `RangeHistogram.nearest_m`), even at the
      picture's edge;
    - CLEAR where no obstacle is found and the camera sees every part of it: each 1 degree slice,
      from the band's top to its bottom at maximum distance, by at least `FREE_SHARE`, with known
      depth that ends on the ground or beyond maximum distance. Near the vehicle the band is taller
      than any camera's picture: clear speaks of the part that the camera sees;
    - UNKNOWN else: outside the picture, partly outside, masked, unknown depth, depth that may end short
      of what makes it clear, or tilted away from the flight level.

    An obstacle at depth d with a relative standard deviation sigma is told at d * (1 - sigma_factor * sigma),
    but for `LARGEST_SHORTENING`; a pixel is clear where depth shortened by `FREEING_SIGMAS` still
    reaches the ground or maximum distance. A surface beyond maximum distance that may so begin within it, by
    `LARGEST_SHORTENING` at most, is told where it begins by the first, or just within maximum distance.
    Whether something is ground or lies in the height band is for d itself to say. Depth more doubtful
    than `max_relative_sigma` frees nothing: it is unknown when far, and an obstacle when near, because to
    ArduPilot unknown is as open as clear.

    Args:
        camera, mount: the camera and how it sits on the vehicle.
        min_distance_m: carried into the scan; nearer obstacles are still reported.
        max_distance_m: horizontal distance that the scan covers.
        below_m, above_m: the height band from the vehicle's origin, metres.
        min_pixels: pixels that make an obstacle at maximum distance; None: `smallest_thing`.
        ground_tolerance: relative error of depth that must not make an obstacle of the ground, 0 to
            0.5. What rises less than this share of the height is lost among the ground.
        max_ground_slope_deg: ground that rises no steeper is no obstacle, as far as its surface is seen and
            while it stays `FLIGHT_CLEARANCE_M` below the flight level; 0 to 25. It needs a known height.
        sigma_factor: standard deviations that distances are shortened by, 0 to 5; 0: not at all.
        max_relative_sigma: depth more doubtful than this is never clear; above 0.
        mask: (H, W) bool, True where the picture is not to be looked at (see `load_image_mask`): unknown.

    Raises:
        ScanError: distances that are not finite with 0 < min < max, a band without height, a sigma_factor,
            max_relative_sigma or slope outside its limits.
        ImageSizeError: a mask that is not (H, W) of the camera.

    Example:
        scanner = ObstacleScanner(camera, CameraMount(pitch_deg=-10))
        scan = scanner.scan(depth.depth_m, attitude, height_m=4.0)
    """

    def __init__(
        self,
        camera: CameraModel,
        mount: CameraMount,
        min_distance_m: float = 0.2,
        max_distance_m: float = 20.0,
        below_m: float = 2.0,
        above_m: float = 1.5,
        min_pixels: int | None = None,
        ground_tolerance: float = GROUND_DEPTH_SHARE,
        sigma_factor: float = 0.25,
        mask: NDArray[np.bool_] | None = None,
        max_ground_slope_deg: float = 15.0,
        max_relative_sigma: float = 0.5,
    ) -> None:
        if not (math.isfinite(max_distance_m) and 0.01 <= min_distance_m < max_distance_m <= 599.0):
            raise ScanError(
                f"distances are {min_distance_m} to {max_distance_m} m: 0.01 <= min < max <= 599 is needed"
            )
        for name, value in (("below_m", below_m), ("above_m", above_m)):
            if not (math.isfinite(value) and value > 0):
                raise ScanError(f"{name} is {value}: a finite height above 0 m is needed")
        if min_pixels is not None and min_pixels < 1:
            raise ScanError(f"min_pixels is {min_pixels}: at least 1 is needed")
        if not 0.0 <= ground_tolerance <= 0.5:
            raise ScanError(f"ground_tolerance is {ground_tolerance}: 0 to 0.5 is needed")
        if not 0.0 <= max_ground_slope_deg <= 25.0:
            raise ScanError(f"max_ground_slope_deg is {max_ground_slope_deg}: 0 to 25 is needed")
        self.camera = camera
        self.mount = mount
        self._caution = ScanCaution(sigma_factor, max_relative_sigma)
        self._mask = None if mask is None else self._of_camera("mask", np.array(mask, dtype=np.bool_))
        self.min_distance_m = float(min_distance_m)
        self.max_distance_m = float(max_distance_m)
        self.below_m = float(below_m)
        self.above_m = float(above_m)
        self._ground_tolerance = ground_tolerance
        self._together = rows_together(camera)
        rays = body_rays(camera, mount)
        self._rays = rays.reshape(3, -1)
        self._joined_rays = mean_of_rows(rays, self._together).reshape(3, -1)
        self._ground_rays = body_rays(camera, mount, _GROUND_STRIDE).reshape(3, -1)
        self._slope_rays = np.ascontiguousarray(rays[:, 1::_SLOPE_ROWS, 4::_SLOPE_COLUMNS]).reshape(3, -1)
        self._sloping = SlopingGround(max_ground_slope_deg, max_distance_m, ground_tolerance)
        self._view = BandView(camera, mount, max_distance_m, below_m, above_m)
        self._histogram = RangeHistogram(self._caution.farthest_m(max_distance_m), self._joined_rays.shape[1])
        if min_pixels is None:
            min_pixels = smallest_thing(camera, max_distance_m)
        self._needed = pixels_of_thing(camera, self._histogram.edges_m, min_pixels, self._together)
        self._line_needed = pixels_of_line(camera, mount, self._together)
        self._speckles = SpeckleFilter(camera)
        self._bearings = sector_bearings_deg()

    def scan(
        self,
        depth_m: NDArray[np.floating],
        attitude: Attitude,
        height_m: float | None = None,
        relative_sigma: NDArray[np.floating] | None = None,
    ) -> ObstacleScan:
        """Scan one depth map.

        Args:
            depth_m: (H, W) z-depth in metres at the camera's pixels; NaN, zero and negative are
                unknown, +inf is nothing there.
            attitude: of the vehicle when the picture was taken; yaw is not used.
            height_m: vehicle's origin above ground, vertically. None, NaN or not above 0: not known;
                then the ground is looked for in the depth itself, and where it is not found beyond
                doubt, whatever lies in the height band is an obstacle.
            relative_sigma: (H, W) one standard deviation of depth over depth; what is NaN is not clear.
                None: depth is taken as exact.

        Raises:
            ImageSizeError: depth or uncertainty that is not (H, W) of the camera.
            ScanError: roll or pitch that is not finite.
        """
        depth = self._of_camera("depth map", np.ascontiguousarray(depth_m, dtype=np.float32))
        if not (math.isfinite(attitude.roll_rad) and math.isfinite(attitude.pitch_rad)):
            raise ScanError(f"attitude is {attitude}: a finite roll and pitch are needed")
        if self._mask is not None:
            depth = np.where(self._mask, np.float32(np.nan), depth)
        sigma = None
        if relative_sigma is not None:
            sigma = self._of_camera("uncertainty", np.asarray(relative_sigma, dtype=np.float32))
        level = attitude.level_from_body
        ground = self._ground(depth, level, height_m)
        rising = self._rising_ground(depth, level, ground)

        joined = nearest_of_rows(self._speckles.without(depth), self._together)
        doubt = None if sigma is None else sigma[:: self._together].ravel()  # it is smooth
        distance = self._nearest(joined.ravel(), level, (ground, rising), doubt)
        clear = self._seen_free(depth.ravel(), level, (ground, rising), sigma)
        state = np.where(clear, SectorState.CLEAR, SectorState.UNKNOWN).astype(np.uint8)
        state[~np.isnan(distance)] = SectorState.OBSTACLE
        return ObstacleScan(distance, state, self._bearings, self.min_distance_m, self.max_distance_m)

    def _of_camera(self, name: str, picture: NDArray[_Pixel]) -> NDArray[_Pixel]:
        if picture.shape != (self.camera.height, self.camera.width):
            raise ImageSizeError(
                f"the {name}'s shape is {picture.shape}, "
                f"the camera's is {(self.camera.height, self.camera.width)}"
            )
        return picture

    def _nearest(
        self,
        depth: NDArray[np.float32],
        level: NDArray[np.float64],
        ground: _Ground,
        doubt: NDArray[np.float32] | None,
    ) -> NDArray[np.float32]:
        """(72,) distance of the nearest obstacle, NaN for none, from every pixel."""
        self._histogram.clear()
        for start in range(0, depth.size, _CHUNK):
            chunk = slice(start, start + _CHUNK)
            rays, chunk_depth = self._joined_rays[:, chunk], depth[chunk]
            near = near_heights(
                rays, chunk_depth, level, self.mount.position_body_m, -self.above_m, self.below_m
            )
            points, range_m = self._level_points(rays.take(near, axis=1), chunk_depth[near], level)
            shortening = reach_m = None
            if doubt is not None:
                shortening, reach_m = self._caution.told(doubt[chunk][near], self.max_distance_m)
            obstacle = self._is_obstacle(points, range_m, ground, reach_m)
            if obstacle.any():
                self._histogram.add(points[0], points[1], range_m, obstacle, shortening)
        distance = self._histogram.nearest_m(self._needed, self._line_needed)
        # What may begin within maximum distance is told there, also where its most likely place is beyond.
        np.minimum(distance, np.float32(_LAST_SHARE * self.max_distance_m), out=distance)
        return distance

    def _seen_free(
        self,
        depth: NDArray[np.float32],
        level: NDArray[np.float64],
        ground: _Ground,
        sigma: NDArray[np.float32] | None,
    ) -> NDArray[np.bool_]:
        """(72,) whether the band is seen and free up to maximum distance."""
        probe = self._view.probe(level)
        probed = depth[probe.pixel]
        rays = self._rays[:, probe.pixel]
        points, range_m = self._level_points(rays, probed, level)
        free = (probed > 0) & ~self._is_obstacle(points, range_m, ground)
        if sigma is not None:
            share = self._caution.least_share(sigma.ravel()[probe.pixel])
            free &= ~np.isnan(share)
            points, range_m = self._level_points(rays, probed * share, level)
            free &= ~self._is_obstacle(points, range_m, ground)
        return seen_sectors(free, probe.cell, FREE_SHARE)

    def _level_points(
        self, rays: NDArray[np.float32], depth: NDArray[np.float32], level: NDArray[np.float64]
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        return level_points(rays, depth, level, self.mount.position_body_m)

    def _is_obstacle(
        self,
        points: NDArray[np.float32],
        range_m: NDArray[np.float32],
        grounds: _Ground,
        reach_m: NDArray[np.float32] | None = None,
    ) -> NDArray[np.bool_]:
        (ground, rising), down_m = grounds, points[2]
        deepest = self.below_m if ground is None else min(self.below_m, ground.deep_m)
        with np.errstate(invalid="ignore"):
            obstacle = down_m >= np.float32(-self.above_m)
            obstacle &= down_m <= np.float32(deepest)
            obstacle &= range_m < (np.float32(self.max_distance_m) if reach_m is None else reach_m)
            if ground is not None:
                limit = range_m * np.float32(-ground.slope)
                limit += np.float32(ground.height_m)
                obstacle &= down_m <= limit
        if rising is not None:
            low = np.flatnonzero(obstacle & (down_m >= np.float32(rising.shallowest_m)))
            obstacle[low] = ~rising.is_ground(points[:, low], range_m[low])
        return np.asarray(obstacle, dtype=np.bool_)

    def _ground(
        self, depth: NDArray[np.float32], level: NDArray[np.float64], height_m: float | None
    ) -> LevelGround | None:
        if height_m is not None and math.isfinite(height_m) and height_m > 0:
            return LevelGround.below(height_m, self._ground_tolerance)
        start = _GROUND_STRIDE // 2
        sparse = depth[start::_GROUND_STRIDE, start::_GROUND_STRIDE].ravel()
        sparse = np.where(sparse > 0, sparse, np.float32(np.nan))
        points, range_m = self._level_points(self._ground_rays, sparse, level)
        directions = level[2].astype(np.float32) @ self._ground_rays
        directions /= np.linalg.norm(self._ground_rays, axis=0)
        return find_level_ground(points[2], range_m, directions, self._ground_tolerance)

    def _rising_ground(
        self, depth: NDArray[np.float32], level: NDArray[np.float64], ground: LevelGround | None
    ) -> GroundProfile | None:
        if ground is None or not self._sloping.may_matter(ground, self.below_m):
            return None
        sparse = depth[1::_SLOPE_ROWS, 4::_SLOPE_COLUMNS].ravel()
        sparse = np.where(sparse > 0, sparse, np.float32(np.nan))
        points, range_m = self._level_points(self._slope_rays, sparse, level)
        return self._sloping.find(points, range_m, ground)
