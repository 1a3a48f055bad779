"""USB and other V4L2 cameras, by number or device path."""

from __future__ import annotations

import time

import cv2
import numpy as np

from service.cameras.camera import Camera, CameraTimeoutError
from service.clock import Clock
from service.errors import CameraError
from service.frame import Frame
from service.settings.camera import CameraSettings

_OLDEST_DRIVER_STAMP_NS = 1_000_000_000
"""A driver's stamp further from now than this is no monotonic time (some drivers count from elsewhere)."""


class UsbCamera(Camera):
    """A V4L2 device through OpenCV.

    Args:
        device: number of the camera, or its path such as `/dev/video0`.
    """

    has_noise = True

    def __init__(self, settings: CameraSettings, clock: Clock, device: int | str) -> None:
        super().__init__(settings, clock)
        self._device = device
        self._capture: cv2.VideoCapture | None = None

    def open(self) -> None:
        self.close()
        backend = cv2.CAP_V4L2 if isinstance(self._device, str) or _has_v4l2() else cv2.CAP_ANY
        capture = cv2.VideoCapture(self._device, backend)
        if not capture.isOpened():
            capture.release()
            raise CameraError(f"camera {self.name}: no such device, or another program uses it")
        capture.set(cv2.CAP_PROP_FRAME_WIDTH, self.settings.width)
        capture.set(cv2.CAP_PROP_FRAME_HEIGHT, self.settings.height)
        capture.set(cv2.CAP_PROP_FPS, self.settings.fps)
        capture.set(cv2.CAP_PROP_BUFFERSIZE, 1)
        self._capture = capture

    @property
    def granted(self) -> str:
        # Cameras accept settings that they do not keep, so they are read back.
        if self._capture is None:
            return ""
        width, height, fps = (
            self._capture.get(prop)
            for prop in (cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT, cv2.CAP_PROP_FPS)
        )
        return f"{width:.0f}x{height:.0f} at {fps:.0f}/s"

    def read(self, timeout_s: float) -> Frame:
        if self._capture is None:
            raise CameraError(f"camera {self.name}: not open")
        whole, image = self._capture.read()
        if not whole:
            raise CameraTimeoutError(f"camera {self.name}: delivers nothing")
        return self._frame(np.asarray(image, np.uint8), self.clock.now_ns() - _age_ns(self._capture))

    def close(self) -> None:
        if self._capture is not None:
            self._capture.release()
            self._capture = None


def _has_v4l2() -> bool:
    return cv2.CAP_V4L2 in cv2.videoio_registry.getCameraBackends()


def _age_ns(capture: cv2.VideoCapture) -> int:
    """How long ago the driver took the picture, or 0 if its stamp cannot be trusted.

    V4L2 stamps buffers with the monotonic clock; OpenCV hands that on as CAP_PROP_POS_MSEC.
    """
    stamp_ns = round(capture.get(cv2.CAP_PROP_POS_MSEC) * 1e6)
    age_ns = time.monotonic_ns() - stamp_ns
    return age_ns if 0 <= age_ns < _OLDEST_DRIVER_STAMP_NS else 0
