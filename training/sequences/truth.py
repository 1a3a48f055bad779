"""Depth of a recording made fit for measuring: z-depth, and no number where nothing is known."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from uavdepth.camera import CameraModel

SKY_M = 10_000.0
"""Simulators give sky a very large depth: TartanAir 10 km, AirSim the largest half float, 65,504 m."""


def usable_truth(depth_m: NDArray[np.floating]) -> NDArray[np.float32]:
    """Depth with NaN where it is NaN, zero or negative, and +inf (sky) from `SKY_M` on.

    Args:
        depth_m: (H, W) z-depth in metres as read.
    """
    depth = depth_m.astype(np.float32)
    depth[~(depth > 0.0)] = np.nan
    depth[depth >= SKY_M] = np.inf
    return depth


def planar_depth(range_m: NDArray[np.floating], camera: CameraModel) -> NDArray[np.float32]:
    """z-depth of (H, W) distances from the camera's centre (AirSim's DepthPerspective)."""
    return np.asarray(range_m * camera.rays[..., 2], np.float32)
