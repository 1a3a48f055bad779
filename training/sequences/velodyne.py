"""LiDAR points as a depth picture."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from training.sequences.errors import BrokenFrameError
from uavdepth.camera import CameraModel

_POINT_BYTES = 16
"""x, y, z and reflectance, float32."""


def read_velodyne(path: Path) -> NDArray[np.float32]:
    """(N, 3) points of one turn, metres, x forward, y left, z up.

    Raises:
        BrokenFrameError: unreadable, or not a whole number of points.
    """
    try:
        content = path.read_bytes()
    except OSError as error:
        raise BrokenFrameError(f"cannot read the LiDAR points {path}: {error.strerror}") from error
    if not content or len(content) % _POINT_BYTES:
        raise BrokenFrameError(f"{path} has {len(content)} bytes: points of {_POINT_BYTES} bytes are needed")
    return np.frombuffer(content, "<f4").reshape(-1, 4)[:, :3].astype(np.float32)


def project_points(
    points: NDArray[np.float32], image_from_points: NDArray[np.float64], camera: CameraModel
) -> NDArray[np.float32]:
    """(H, W) z-depth of the points that fall on the picture, NaN elsewhere; the nearest of a pixel counts.

    Args:
        points: (N, 3) in the LiDAR's axes, metres.
        image_from_points: (3, 4) projection onto pixels whose first has its centre at 0, times z-depth.
        camera: size of the picture.
    """
    depth = np.full((camera.height, camera.width), np.inf, np.float32)
    ahead = points[np.isfinite(points).all(axis=1) & (points[:, 0] > 0.0)].astype(np.float64)
    image = ahead @ image_from_points[:, :3].T + image_from_points[:, 3]
    image = image[image[:, 2] > 0.0]
    z = image[:, 2]
    column, row = (np.rint(image[:, axis] / z) for axis in (0, 1))
    inside = (column >= 0) & (column < camera.width) & (row >= 0) & (row < camera.height)
    pixel = (row[inside].astype(np.int64), column[inside].astype(np.int64))
    np.minimum.at(depth, pixel, z[inside].astype(np.float32))
    depth[np.isinf(depth)] = np.nan
    return depth
