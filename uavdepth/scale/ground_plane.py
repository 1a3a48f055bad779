"""The plane of the ground in one picture, in the camera's own frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavdepth.attitude import Attitude
from uavdepth.camera import CameraModel, CameraMount
from uavdepth.errors import ImageSizeError

_COLUMNS = 80
_MIN_POINTS = 60
_NEAR = 0.05
"""Of depth: points within it of the plane belong to it."""

_MIN_SHARE = 0.5
"""Of the points below the horizon: less, and it is one surface among several."""

_MAX_TILT_DEG = 25.0
"""From level, by the configured mount: farther it is a wall, a roof or a mount that was never measured."""

_TRIALS = 60
_REFINEMENTS = 3
_MIN_DEPRESSION = 0.03
"""Downward part of a ray over its length, by the configured mount: nearer to the horizon depth is poor."""


@dataclass(frozen=True)
class GroundPlane:
    """A plane that may be the ground.

    Args:
        normal_camera: (3,) unit vector towards the ground (down), camera frame.
        share: share of the points below the horizon that lie on it.
        attitude: the vehicle's at the picture's capture.
    """

    normal_camera: tuple[float, float, float]
    share: float
    attitude: Attitude


def find_ground_plane(
    depth_m: NDArray[np.float32],
    camera: CameraModel,
    mount: CameraMount,
    attitude: Attitude,
    seed: int = 0,
) -> GroundPlane | None:
    """The plane on which most of what lies below the horizon stands, or None in doubt.

    Depth up to an unknown factor is enough: the normal does not depend on it. A plane is linear in inverse
    depth, 1/z = (a x + b y + c), which is fitted with weights for an error that is a share of depth.

    Depth from a network that was told the ground's plane (`GroundHint`) must not be used: it would answer
    with the mount that it was told.

    Args:
        depth_m: (H, W) float32 z-depth in metres or up to one factor; NaN or inf where unknown or sky.
        camera: of the same size.
        mount: as configured; only chooses the pixels and turns away walls.
        attitude: at capture.
        seed: of the random trials (RANSAC, Fischler and Bolles 1981).

    Raises:
        ImageSizeError: a depth map of another size than the camera's.
    """
    if depth_m.shape != (camera.height, camera.width):
        raise ImageSizeError(
            f"depth map is {depth_m.shape[1]}x{depth_m.shape[0]}, the camera {camera.width}x{camera.height}"
        )
    stride = max(1, round(camera.width / _COLUMNS))
    start = stride // 2
    rays = camera.normalized_rays[start::stride, start::stride].reshape(-1, 3).astype(np.float64)
    depth = depth_m[start::stride, start::stride].ravel().astype(np.float64)
    down_camera = (attitude.level_from_body @ mount.body_from_camera).T @ np.array([0.0, 0.0, 1.0])
    below = rays @ down_camera > _MIN_DEPRESSION * np.linalg.norm(rays, axis=1)
    known = below & np.isfinite(depth) & (depth > 0)
    if np.count_nonzero(known) < max(_MIN_POINTS, _MIN_SHARE * np.count_nonzero(below)):
        return None
    rays, inverse = rays[known], 1.0 / depth[known]
    plane = _best_plane(rays, inverse, down_camera, np.random.default_rng(seed))
    if plane is None:
        return None
    for _ in range(_REFINEMENTS):
        on = _on_plane(plane, rays, inverse)
        if np.count_nonzero(on) < _MIN_POINTS:
            return None
        weight = 1.0 / inverse[on]
        plane = np.linalg.lstsq(rays[on] * weight[:, None], np.ones(len(weight)), rcond=None)[0]
    share = float(np.mean(_on_plane(plane, rays, inverse)))
    normal = plane / np.linalg.norm(plane)
    if share < _MIN_SHARE or normal @ down_camera < np.cos(np.radians(_MAX_TILT_DEG)):
        return None
    return GroundPlane((float(normal[0]), float(normal[1]), float(normal[2])), share, attitude)


def _best_plane(
    rays: NDArray[np.float64],
    inverse: NDArray[np.float64],
    down_camera: NDArray[np.float64],
    rng: np.random.Generator,
) -> NDArray[np.float64] | None:
    """(3,) a, b, c of the plane through three points on which most points lie and that is fairly level."""
    triples = rng.integers(0, len(rays), (_TRIALS, 3))
    matrices = rays[triples]
    usable = np.abs(np.linalg.det(matrices)) > 1e-4
    if not usable.any():
        return None
    planes = np.linalg.solve(matrices[usable], inverse[triples[usable]][..., None])[..., 0]
    level = planes @ down_camera > np.cos(np.radians(_MAX_TILT_DEG)) * np.linalg.norm(planes, axis=1)
    if not level.any():
        return None
    planes = planes[level]
    counts = np.count_nonzero(np.abs(rays @ planes.T / inverse[:, None] - 1) < _NEAR, axis=0)
    return np.asarray(planes[int(np.argmax(counts))], np.float64)


def _on_plane(
    plane: NDArray[np.float64], rays: NDArray[np.float64], inverse: NDArray[np.float64]
) -> NDArray[np.bool_]:
    return np.asarray(np.abs(rays @ plane / inverse - 1) < _NEAR, np.bool_)
