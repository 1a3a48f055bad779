"""Hints as pictures for the network: inverse depth at its input size, in its own unit.

The unit is q = f / (focal_px * depth), f being the camera's focal length in pixels of the network's width:
log q is what the output kind `log_inverse_depth` of a model card holds. 0 means "nothing known here".
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from uavdepth.camera import CameraModel
from uavdepth.errors import HintError
from uavdepth.model.hints import GroundHint, PointHints
from uavdepth.model.point_pixels import PointPixels

FARTHEST_GROUND_M = 200.0
"""From 3.5 m up, ground so far away lies 1 degree below the horizon: as much as an attitude is wrong."""

LOWEST_CAMERA_M = 0.05
"""A camera nearer to the plane, or below it, sees no ground: the height is wrong or the vehicle stands."""

MOST_POINTS = 300
"""Of more points the surest are used: networks are trained with up to so many."""

NEAREST_POINT_M = 0.05
"""Points nearer than this are taken for so near: no lens focuses there, and q stays a number."""

HALF_CONFIDENCE_SIGMA = 0.1
"""Relative standard deviation of a point whose confidence is one half."""


def ground_plane(
    hint: GroundHint, camera: CameraModel, width: int, height: int, focal_px: float
) -> NDArray[np.float32]:
    """(height, width) float32 q of the flat ground at the network's pixels.

    Args:
        hint: the ground.
        camera: of the picture, before it is resized to the network's size.
        width, height: the network's input size, pixels.
        focal_px: focal length that the network's output is normalised to, pixels.

    Returns:
        0 above the horizon, beyond `FARTHEST_GROUND_M` of z-depth, and everywhere where the camera is
        lower than `LOWEST_CAMERA_M`.

    Raises:
        HintError: a size or focal length that is not above 0.
    """
    _check_unit(width, height, focal_px)
    camera_height_m = hint.camera_height_m
    if camera_height_m < LOWEST_CAMERA_M:
        return np.zeros((height, width), dtype=np.float32)
    # Down in camera axes: a point at z-depth d along the ray r lies d * (down . r) below the camera.
    down = hint.attitude.level_from_body[2] @ hint.mount.body_from_camera
    q = _along(down * (_focal(camera, width) / (focal_px * camera_height_m)), camera, width, height)
    q[~(q >= np.float32(_focal(camera, width) / (focal_px * FARTHEST_GROUND_M)))] = 0.0
    return q


def point_pixels(
    points: PointHints, camera: CameraModel, width: int, height: int, focal_px: float
) -> PointPixels:
    """The points at the network's pixels, with the confidence in them.

    Confidence is 1 / (1 + (relative_sigma / 0.1)^2), from 1 for an exact point towards 0. Points outside
    the picture are left out; of more than `MOST_POINTS` the surest stay, of several in one pixel the
    surest, and of equally sure ones the nearest.

    Args:
        points: in the camera's pixels.
        camera, width, height, focal_px: as in `ground_plane`.

    Raises:
        HintError: a size or focal length that is not above 0.
    """
    _check_unit(width, height, focal_px)
    # Pixel i covers i - 0.5 to i + 0.5, so the camera's picture begins at -0.5, as the network's does.
    scale = np.array([width / camera.width, height / camera.height])
    cell = np.floor((points.pixels.astype(np.float64) + 0.5) * scale)
    inside = np.all((cell >= 0) & (cell < (width, height)), axis=1)
    column, row = cell[inside].astype(np.intp).T
    depth_m = np.maximum(points.depth_m[inside].astype(np.float64), NEAREST_POINT_M)
    sigma = points.relative_sigma[inside].astype(np.float64)
    surest = np.lexsort((depth_m, sigma))[:MOST_POINTS]
    _, first = np.unique(row[surest] * width + column[surest], return_index=True)
    chosen = surest[first]
    q = (_focal(camera, width) / (focal_px * depth_m[chosen])).astype(np.float32)
    confidence = (1.0 / (1.0 + (sigma[chosen] / HALF_CONFIDENCE_SIGMA) ** 2)).astype(np.float32)
    return PointPixels(width, height, row[chosen], column[chosen], q, confidence)


def _focal(camera: CameraModel, width: int) -> float:
    """Focal length in pixels of a picture resized to `width`."""
    return camera.fx * width / camera.width


def _check_unit(width: int, height: int, focal_px: float) -> None:
    if width < 1 or height < 1:
        raise HintError(f"the network's size is {width}x{height}: at least 1x1 is needed")
    if not (np.isfinite(focal_px) and focal_px > 0):
        raise HintError(f"focal_px is {focal_px}: a finite focal length above 0 pixels is needed")


def _along(
    direction: NDArray[np.float64], camera: CameraModel, width: int, height: int
) -> NDArray[np.float32]:
    """(height, width) float32 product of a direction (camera axes) with the pixels' rays of z = 1."""
    if any(camera.distortion):
        rays = _distorted_rays(camera, width, height)
        return np.asarray(direction.astype(np.float32) @ rays, dtype=np.float32).reshape(height, width)
    # Without distortion x depends on the column alone and y on the row alone: nothing to keep.
    resized = camera.scaled(width, height)
    x = direction[0] * (np.arange(width) - resized.cx) / resized.fx
    y = direction[1] * (np.arange(height) - resized.cy) / resized.fy + direction[2]
    return np.asarray(x.astype(np.float32)[None, :] + y.astype(np.float32)[:, None], dtype=np.float32)


@lru_cache(maxsize=8)
def _distorted_rays(camera: CameraModel, width: int, height: int) -> NDArray[np.float32]:
    """(3, height * width) float32 rays; straightening a picture's worth of pixels takes 0.1 s."""
    rays = camera.scaled(width, height).normalized_rays.reshape(-1, 3)
    kept = np.ascontiguousarray(rays.T)
    kept.flags.writeable = False
    return kept
