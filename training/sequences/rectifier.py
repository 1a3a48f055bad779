"""Pictures of a real lens made pictures of a pinhole, which is all that re-projection knows."""

from __future__ import annotations

from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from uavdepth.camera import CameraModel


class Rectifier:
    """Takes the distortion out of pictures; one without distortion passes as it is.

    Args:
        camera: as calibrated.
    """

    def __init__(self, camera: CameraModel) -> None:
        self._lens = camera

    @cached_property
    def camera(self) -> CameraModel:
        """The pinhole of the rectified pictures: the same size, cut so that every pixel was really seen."""
        lens = self._lens
        if not any(lens.distortion):
            return CameraModel(lens.width, lens.height, lens.fx, lens.fy, lens.cx, lens.cy)
        size = (lens.width, lens.height)
        k = cv2.getOptimalNewCameraMatrix(lens.matrix, np.array(lens.distortion), size, 0.0)[0]
        return CameraModel(*size, float(k[0, 0]), float(k[1, 1]), float(k[0, 2]), float(k[1, 2]))

    def apply(self, picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """(H, W, 3) rectified picture."""
        if not any(self._lens.distortion):
            return picture
        return np.asarray(cv2.remap(picture, *self._maps, cv2.INTER_LINEAR), np.uint8)

    @cached_property
    def _maps(self) -> tuple[NDArray[np.int16], NDArray[np.uint16]]:
        lens = self._lens
        size = (lens.width, lens.height)
        distortion = np.array(lens.distortion)
        first, second = cv2.initUndistortRectifyMap(
            lens.matrix, distortion, np.eye(3), self.camera.matrix, size, cv2.CV_16SC2
        )
        return np.asarray(first, np.int16), np.asarray(second, np.uint16)
