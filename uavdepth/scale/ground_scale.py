"""Metres from the ground: the factor between a network's depth and the plane under the vehicle."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavdepth.attitude import Attitude
from uavdepth.camera import CameraModel, CameraMount
from uavdepth.errors import ImageSizeError
from uavdepth.scale.ground_doubt import doubt_of_slope, doubt_of_surface
from uavdepth.scan.body_rays import body_rays

MIN_HEIGHT_M = 0.3
"""Lower, the rangefinder's error and the landing gear are as large as the height."""

MIN_PLANE_DEPTH_M = 0.3
MAX_PLANE_DEPTH_M = 60.0

MIN_DEPRESSION = math.sin(math.radians(4.0))
"""Rays nearer to the horizon are left out: there an attitude error of 1 degree is 25 % of depth and more."""

_COLUMNS = 160
"""Pixels are taken from a grid of about so many columns: one factor needs no more of them."""

_LARGEST_LOG_FACTOR = math.log(50.0)
_BIN = 0.02
_BINS = math.ceil(2 * _LARGEST_LOG_FACTOR / _BIN)
_KERNEL = np.hanning(11)[1:-1] / np.hanning(11)[1:-1].sum()
"""Smooths the histogram over about +-5 %, the scatter of a network on smooth ground."""

_TILES = 8
"""The picture is cut into 8 x 8 tiles: ground that is ground says the same factor in many of them."""

_MIN_PIXELS = 100
_MIN_TILES = 4
_MIN_TILE_PIXELS = 10
_MIN_SHARE = 0.1
_GATE = 0.25
"""Pixels within this ratio (in logs) of the mode are taken as ground."""

_NARROWEST_GATE = 0.02
_REFINEMENTS = 4

_RIVAL = 0.7
_RIVAL_DISTANCE = 0.3
"""A second peak of this share of the first, this far away in logs, makes the answer ambiguous."""

_LARGEST_SIGMA = 0.25
_LARGEST_SPREAD = 0.2
_SLOPES = (0.65, 1.4)
"""Of log depth over log of the plane's depth. Level ground has 1, a wall 0; ground that falls or rises
by 12 % lies at these ends, and there the factor is wrong by a quarter."""

_MIN_LOG_REACH = 0.06
_FLOOR_SIGMA = 0.02


@dataclass(frozen=True)
class GroundScale:
    """Factor that turns a network's depth into metres.

    Args:
        factor: metres for each unit of the network's depth.
        relative_sigma: one standard deviation of the factor over the factor.
        pixels: pixels that agreed on it, of a grid of about 160 columns.
    """

    factor: float
    relative_sigma: float
    pixels: int

    @property
    def is_sure(self) -> bool:
        """Whether it may be followed: beyond a quarter of doubt most likely not the ground is seen."""
        return self.relative_sigma <= _LARGEST_SIGMA


def vertical_height_m(range_m: float, attitude: Attitude) -> float:
    """Height above level ground from a rangefinder that looks along the body's down axis.

    Args:
        range_m: what it measured, metres.
        attitude: when it measured.
    """
    return range_m * math.cos(attitude.roll_rad) * math.cos(attitude.pitch_rad)


class GroundScaler:
    """Finds the factor by comparing depth below the horizon with level ground at a known height.

    Level ground at a known height has one depth at each pixel. Where the picture shows that ground,
    plane over network is the factor; where something stands on it, the network is nearer and the
    ratio larger, by all sorts of amounts. So the factor is the mode of the ratios, refined by the
    median around it, and it is believed only where tiles of the picture agree and depth falls towards
    the horizon as ground does: a wall, which has one depth at all rows, fails.

    The ground is taken as level. On a slope of s the factor is wrong by about s over the tangent of
    the angle at which the camera looks down (7 % for a slope of 2 % seen 16 degrees below the horizon).

    What no picture tells: a level surface at another depth, such as a valley floor or a flat roof, with
    none of the ground under the vehicle in view. For a network that is metric by itself say what
    factors are plausible.

    Args:
        camera, mount: the camera and how it sits on the vehicle.
        plausible: smallest and largest factor that is believed, or None for any.

    Raises:
        ValueError: plausible factors that are not 0 < smallest < largest.
    """

    def __init__(
        self, camera: CameraModel, mount: CameraMount, plausible: tuple[float, float] | None = None
    ) -> None:
        if plausible is not None and not 0 < plausible[0] < plausible[1]:
            raise ValueError(f"plausible factors are {plausible}: 0 < smallest < largest is needed")
        self._plausible = plausible or (0.0, math.inf)
        self.camera = camera
        self.mount = mount
        self._stride = max(1, round(camera.width / _COLUMNS))
        rays = body_rays(camera, mount, self._stride)
        self._shape = rays.shape[1:]
        self._rays = rays.reshape(3, -1)
        self._per_length = (1.0 / np.linalg.norm(self._rays, axis=0)).astype(np.float32)
        rows, columns = (np.arange(size) * _TILES // size for size in self._shape)
        self._tile = (rows[:, None] * _TILES + columns[None, :]).ravel()

    def estimate(
        self, depth_m: NDArray[np.floating], attitude: Attitude, height_m: float | None
    ) -> GroundScale | None:
        """The factor of one picture, or None where the ground does not tell it beyond doubt.

        Args:
            depth_m: (H, W) the network's z-depth at the camera's pixels, up to a factor; NaN unknown.
            attitude: of the vehicle when the picture was taken; yaw is not used.
            height_m: vertical height of the vehicle's origin above ground; None where it is not known.

        Returns:
            None without height, below `MIN_HEIGHT_M`, with too few ground pixels, with two factors
            equally likely, with one that is not plausible, or where the picture's parts disagree.

        Raises:
            ImageSizeError: depth that is not (H, W) of the camera.
        """
        if np.shape(depth_m) != (self.camera.height, self.camera.width):
            raise ImageSizeError(
                f"the depth map's shape is {np.shape(depth_m)}, "
                f"the camera's is {(self.camera.height, self.camera.width)}"
            )
        if height_m is None or not math.isfinite(height_m) or height_m < MIN_HEIGHT_M:
            return None
        if not (math.isfinite(attitude.roll_rad) and math.isfinite(attitude.pitch_rad)):
            return None
        log_plane, log_ratio, tile, endless = self._ratios(np.asarray(depth_m), attitude, height_m)
        if log_ratio.size < _MIN_PIXELS:
            return None
        # A network that is not metric may count in any unit: factors are searched around its own.
        centre = np.float32(_median(log_ratio) if math.isinf(self._plausible[1]) else 0.0)
        mode = _mode(log_ratio - centre)
        if mode is None:
            return None
        mode += float(centre)
        near = np.abs(log_ratio - np.float32(mode)) < _GATE
        seen_plane, seen_ratio = log_plane, log_ratio
        log_plane, log_ratio, tile = log_plane[near], log_ratio[near], tile[near]
        log_factor, gate = _refine(log_ratio, mode)
        if not self._plausible[0] <= math.exp(log_factor) <= self._plausible[1]:
            return None
        ground = np.abs(log_ratio - np.float32(log_factor)) < gate
        reach = float(log_plane[ground].std())
        if reach < _MIN_LOG_REACH:
            return None
        slope = _slope(log_plane, log_plane - log_ratio)
        if not _SLOPES[0] <= slope <= _SLOPES[1]:
            return None
        spread, tiles = _spread(log_ratio - np.float32(log_factor), tile)
        if tiles < _MIN_TILES or spread > _LARGEST_SPREAD:
            return None
        # Ground that falls lies beneath level ground far off, and is no other surface.
        fallen = np.float32(slope - 1.0) * (seen_plane - log_plane.mean())
        off = seen_ratio - np.float32(log_factor) + fallen
        surface = doubt_of_surface(seen_plane, off, _GATE, endless)
        sigma = math.hypot(_FLOOR_SIGMA, spread, doubt_of_slope(slope, reach, spread, tiles), surface)
        return GroundScale(math.exp(log_factor), sigma, int(log_ratio.size))

    def _ratios(
        self, depth: NDArray[np.floating], attitude: Attitude, height_m: float
    ) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.intp], int]:
        """Log plane depth, log of plane over network, and tile of the pixels that look at the ground; and how
        many more would, but see no end."""
        level = attitude.level_from_body
        camera_height = height_m - float(level[2] @ self.mount.position_body_m)
        start = self._stride // 2
        sparse = depth[start :: self._stride, start :: self._stride].astype(np.float32).ravel()
        down = level[2].astype(np.float32) @ self._rays
        # z-depth of the plane is camera_height / down; the limits on it become limits on down.
        looks = down > np.float32(max(camera_height, 1e-3) / MAX_PLANE_DEPTH_M)
        looks &= down < np.float32(camera_height / MIN_PLANE_DEPTH_M)
        looks &= down * self._per_length > np.float32(MIN_DEPRESSION)
        endless = int(np.count_nonzero(looks & np.isposinf(sparse)))
        looks &= (sparse > 0) & (sparse < np.inf)
        pixel = np.flatnonzero(looks)
        log_plane = np.float32(math.log(max(camera_height, 1e-3))) - np.log(down[pixel])
        return log_plane, log_plane - np.log(sparse[pixel]), self._tile[pixel], endless


def _mode(log_ratio: NDArray[np.float32]) -> float | None:
    """The most frequent log ratio, or None where too few agree or a rival peak is as good."""
    keys = ((log_ratio + np.float32(_LARGEST_LOG_FACTOR)) * np.float32(1 / _BIN)).astype(np.int64)
    keys = keys[(keys >= 0) & (keys < _BINS)]
    smooth = np.convolve(np.bincount(keys, minlength=_BINS), _KERNEL, mode="same")
    peak = int(smooth.argmax())
    away = np.abs(np.arange(_BINS) - peak) * _BIN > _RIVAL_DISTANCE
    within = np.abs(keys - peak) * _BIN < _GATE
    if np.count_nonzero(within) < max(_MIN_PIXELS, _MIN_SHARE * log_ratio.size):
        return None
    if smooth[away].max(initial=0.0) > _RIVAL * smooth[peak]:
        return None
    return (peak + 0.5) * _BIN - _LARGEST_LOG_FACTOR


def _refine(log_ratio: NDArray[np.float32], mode: float) -> tuple[float, float]:
    """Median around the mode, the gate shrinking to the scatter that is really there; and that gate."""
    centre, gate = mode, _GATE
    for _ in range(_REFINEMENTS):
        distance = np.abs(log_ratio - np.float32(centre))
        inside = distance < gate
        if np.count_nonzero(inside) < _MIN_PIXELS // 2:
            break
        scatter = 1.4826 * _median(distance[inside])
        centre = _median(log_ratio[inside])
        gate = min(gate, max(2.0 * scatter, _NARROWEST_GATE))
    return centre, gate


def _median(values: NDArray[np.floating]) -> float:
    """Upper median: a quarter of the time of numpy's, whose checks cost more than its work here."""
    middle = values.size // 2
    return float(np.partition(values, middle)[middle])


def _slope(log_plane: NDArray[np.float32], log_depth: NDArray[np.float32]) -> float:
    """Slope of log depth over the log of the plane's depth."""
    spread = log_plane - log_plane.mean()
    return float(spread @ log_depth) / float(spread @ spread)


def _spread(error: NDArray[np.float32], tile: NDArray[np.intp]) -> tuple[float, int]:
    """How far the picture's tiles are apart, as one standard deviation, and how many there are.

    It is not divided by the number of tiles: neighbouring tiles err together.
    """
    counts = np.bincount(tile, minlength=_TILES**2)
    filled = counts >= _MIN_TILE_PIXELS
    tiles = int(np.count_nonzero(filled))
    if not tiles:
        return math.inf, 0
    sums = np.bincount(tile, weights=error, minlength=_TILES**2)
    return 1.4826 * _median(np.abs(sums[filled] / counts[filled])), tiles
