"""Where the pixels look, seen from the vehicle."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from uavdepth.camera import CameraModel, CameraMount


def body_rays(camera: CameraModel, mount: CameraMount, stride: int = 1) -> NDArray[np.float32]:
    """(3, H, W) float32 directions of the pixels in body FRD; times z-depth they lead from camera to point.

    Args:
        camera, mount: the camera and how it sits on the vehicle.
        stride: take every stride-th row and column, starting in the middle of the first block.
    """
    start = stride // 2
    rays = camera.normalized_rays[start::stride, start::stride].astype(np.float64)
    turned = np.moveaxis(rays @ mount.body_from_camera.T, -1, 0)
    return np.ascontiguousarray(turned, dtype=np.float32)
