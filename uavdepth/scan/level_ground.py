"""The ground under the vehicle as a level plane: what belongs to it, and how deep it lies."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

GROUND_FLOOR_M = 0.3
"""Grass, kerbs and the rangefinder's own error: nothing lower is told from the ground."""

GROUND_DEPTH_SHARE = 0.2
"""A depth that is wrong by a factor s puts a ground point at s times its depth below the vehicle: the
error is a share of the height. More would lose a box of 0.5 m seen from 2 m; a network whose errors
reach farther makes obstacles of the ground, but only where the height band reaches the ground."""

GROUND_SLOPE = 0.03
"""Slope of the ground plus error of the attitude at capture, 1.7 degrees: it grows with distance."""

_SMALLEST_HEIGHT_M = 0.6
_LARGEST_HEIGHT_M = 60.0
_BIN = 0.05
_BINS = math.ceil(math.log(_LARGEST_HEIGHT_M / _SMALLEST_HEIGHT_M) / _BIN)
_NEAR_MODE = 2
"""Bins on each side of the fullest one that still belong to it: 10 %."""

_ENOUGH_POINTS = 12
_GROUND_SHARE = 0.3
_GROUND_REACH = 1.5


@dataclass(frozen=True)
class LevelGround:
    """Where the ground begins, as limits on a point's depth below the vehicle.

    A point is ground when it lies deeper than `deep_m`, or deeper than `height_m - slope * distance`.

    Args:
        height_m: vehicle's origin above the ground.
        deep_m: depth below the vehicle from which on everything is ground, whatever its distance.
        slope: metres by which the limit rises a metre of distance.
    """

    height_m: float
    deep_m: float
    slope: float

    @classmethod
    def below(cls, height_m: float, depth_share: float = GROUND_DEPTH_SHARE) -> LevelGround:
        """The ground at a height.

        Args:
            height_m: vehicle's origin above the ground.
            depth_share: relative error of depth that must not make an obstacle of the ground.
        """
        tolerance = max(GROUND_FLOOR_M, depth_share * height_m)
        return cls(height_m, height_m - tolerance, GROUND_SLOPE)


def find_level_ground(
    down_m: NDArray[np.float32],
    range_m: NDArray[np.float32],
    depression: NDArray[np.float32],
    depth_share: float = GROUND_DEPTH_SHARE,
) -> LevelGround | None:
    """The ground found in the depth itself, for a vehicle that does not know its height.

    Ground is a surface at one depth below the vehicle that reaches from near to far and makes up much
    of what lies below the horizon. A wall fails the reach, a scatter of things the share. Doubt gives
    None, and then everything in the height band counts as an obstacle, ground included.

    Args:
        down_m: (N,) float32 depth of points below the vehicle's origin; NaN where unknown.
        range_m: (N,) float32 their horizontal distance.
        depression: (N,) float32 downward part of their rays, over its length; above 0 below the horizon.
        depth_share: as in `LevelGround.below`.
    """
    with np.errstate(invalid="ignore"):
        low = (down_m > _SMALLEST_HEIGHT_M) & (down_m < _LARGEST_HEIGHT_M)
    below_horizon = int(np.count_nonzero((depression > 0.05) & ~np.isnan(down_m)))
    down, reach = down_m[low], range_m[low]
    if down.size < _ENOUGH_POINTS:
        return None
    keys = (np.log(down / np.float32(_SMALLEST_HEIGHT_M)) / _BIN).astype(np.intp)
    counts = np.bincount(np.minimum(keys, _BINS - 1), minlength=_BINS)
    mode = int(np.convolve(counts, np.ones(2 * _NEAR_MODE + 1, dtype=int), mode="same").argmax())
    near_mode = np.abs(keys - mode) <= _NEAR_MODE
    found = int(np.count_nonzero(near_mode))
    if found < max(_ENOUGH_POINTS, _GROUND_SHARE * below_horizon):
        return None
    nearest, farthest = np.percentile(reach[near_mode], (10, 90))
    if farthest < _GROUND_REACH * nearest:
        return None
    return LevelGround.below(float(np.median(down[near_mode])), depth_share)
