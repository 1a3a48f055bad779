"""Pixels as points in the level frame, as seen from the vehicle's origin."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

_ROUNDING_M = 0.01
"""Far above what single precision leaves of a height, for who only looks where it pays to look closer."""


def level_points(
    rays: NDArray[np.float32],
    depth: NDArray[np.float32],
    level_from_body: NDArray[np.float64],
    camera_body_m: NDArray[np.float64],
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """(3, N) points in the level frame from the vehicle's origin, and (N,) their horizontal distance.

    Args:
        rays: (3, N) directions in body axes, of z-depth 1.
        depth: (N,) z-depth, metres.
        level_from_body: (3, 3) rotation by roll and pitch.
        camera_body_m: (3,) where the camera sits.
    """
    points = np.matmul(level_from_body.astype(np.float32), rays)
    with np.errstate(invalid="ignore", over="ignore"):
        points *= depth
        origin = level_from_body @ camera_body_m
        if origin.any():
            points += origin.astype(np.float32)[:, None]
        range_m = points[0] * points[0]
        range_m += points[1] * points[1]
        np.sqrt(range_m, out=range_m)
    return points, range_m


def near_heights(
    rays: NDArray[np.float32],
    depth: NDArray[np.float32],
    level_from_body: NDArray[np.float64],
    camera_body_m: NDArray[np.float64],
    highest_m: float,
    lowest_m: float,
) -> NDArray[np.intp]:
    """Numbers of the pixels that may lie in a height band: of most pictures most is ground and sky.

    Args:
        rays, depth, level_from_body, camera_body_m: as for `level_points`.
        highest_m, lowest_m: ends of the band, metres below the vehicle's origin.
    """
    down_m = level_from_body[2].astype(np.float32) @ rays
    with np.errstate(invalid="ignore", over="ignore"):
        down_m *= depth
        down_m += np.float32(level_from_body[2] @ camera_body_m)
        inside = down_m >= np.float32(highest_m - _ROUNDING_M)
        inside &= down_m <= np.float32(lowest_m + _ROUNDING_M)
    return np.flatnonzero(inside)
