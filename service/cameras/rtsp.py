"""Network cameras over RTSP."""

from __future__ import annotations

import re

import cv2
import numpy as np

from service.cameras.camera import Camera, CameraTimeoutError
from service.clock import Clock
from service.errors import CameraError
from service.frame import Frame
from service.settings.camera import CameraSettings


class RtspCamera(Camera):
    """An `rtsp://` or `rtsps://` stream through FFmpeg.

    The stream carries no clock that both ends share: set `latency_ms` to the camera's measured delay.
    """

    def __init__(self, settings: CameraSettings, clock: Clock) -> None:
        super().__init__(settings, clock)
        self._capture: cv2.VideoCapture | None = None

    @property
    def name(self) -> str:
        return without_password(self.settings.source)

    def open(self) -> None:
        self.close()
        # Without these two a dead server blocks OpenCV for 30 s (measured).
        limits = [
            cv2.CAP_PROP_OPEN_TIMEOUT_MSEC,
            round(self.settings.open_timeout_s * 1000),
            cv2.CAP_PROP_READ_TIMEOUT_MSEC,
            round(self.settings.read_timeout_s * 1000),
        ]
        capture = cv2.VideoCapture(self.settings.source, cv2.CAP_FFMPEG, limits)
        if not capture.isOpened():
            capture.release()
            raise CameraError(
                f"camera {self.name}: no stream within {self.settings.open_timeout_s:g} s, or refused"
            )
        self._capture = capture

    def read(self, timeout_s: float) -> Frame:
        if self._capture is None:
            raise CameraError(f"camera {self.name}: not open")
        whole, image = self._capture.read()
        if not whole:
            raise CameraTimeoutError(
                f"camera {self.name}: no picture within {self.settings.read_timeout_s:g} s, or stream ended"
            )
        return self._frame(np.asarray(image, np.uint8), self.clock.now_ns())

    def close(self) -> None:
        if self._capture is not None:
            self._capture.release()
            self._capture = None


def without_password(url: str) -> str:
    """`url` as it may stand in a log: user name and password left out."""
    return re.sub(r"//[^/@]*@", "//***@", url)
