"""Noise of single pixels, which is no obstacle."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from uavdepth.camera import CameraModel

_NEIGHBOURS = np.array([[1, 1, 1], [1, 0, 1], [1, 1, 1]], dtype=np.uint8)


class SpeckleFilter:
    """Takes single near pixels out of depth maps. Keeps working memory: use one for each thread.

    Args:
        camera: whose pictures they are.
    """

    def __init__(self, camera: CameraModel) -> None:
        self._known = np.empty((camera.height, camera.width), dtype=np.float32)
        self._neighbours = np.empty_like(self._known)

    def without(self, depth: NDArray[np.float32]) -> NDArray[np.float32]:
        """Depth with unknown as +inf, and single pixels pushed back to the nearest of their neighbours.

        A line one pixel wide, such as a thin pole or a wire, stays: its pixels have each other.

        Args:
            depth: (H, W), not above 0 or NaN where unknown.

        Returns:
            (H, W), overwritten by the next call.
        """
        known, neighbours = self._known, self._neighbours
        known.fill(np.inf)
        np.copyto(known, depth, where=depth > 0)
        cv2.erode(known, _NEIGHBOURS, dst=neighbours)
        return np.maximum(known, neighbours, out=known)
