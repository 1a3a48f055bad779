"""Rows of a picture joined in groups: nothing near is lost, and tall pictures cost no more than low ones."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from uavdepth.camera import CameraModel

ROWS_LEFT = 160
"""Rows are joined until about so many are left, so that the time of a scan does not grow with the picture."""


def rows_together(camera: CameraModel) -> int:
    """How many rows of a camera's pictures make one group."""
    return max(1, round(camera.height / ROWS_LEFT))


def nearest_of_rows(depth: NDArray[np.float32], together: int) -> NDArray[np.float32]:
    """(ceil(H / together), W) smallest depth of each group of rows of (H, W)."""
    nearest = depth[::together].copy()
    for row in range(1, together):
        part = depth[row::together]
        np.minimum(nearest[: len(part)], part, out=nearest[: len(part)])
    return nearest


def mean_of_rows(rays: NDArray[np.float32], together: int) -> NDArray[np.float32]:
    """(3, ceil(H / together), W) mean direction of each group of rows of (3, H, W)."""
    groups = np.arange(0, rays.shape[1], together)
    sizes = np.diff(np.append(groups, rays.shape[1]))
    total = np.add.reduceat(rays.astype(np.float64), groups, axis=1)
    return np.ascontiguousarray(total / sizes[:, None], dtype=np.float32)
