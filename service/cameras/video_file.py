"""A video file, played at its own pace."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from service.cameras.camera import Camera, CameraEndedError
from service.cameras.pace import Pace
from service.clock import Clock
from service.errors import CameraError, ConfigError
from service.frame import Frame
from service.settings.camera import CameraSettings

_SENSIBLE_FPS = (1.0, 240.0)


class VideoFileCamera(Camera):
    """A file that FFmpeg can read.

    Args:
        path: the file.
    """

    def __init__(self, settings: CameraSettings, clock: Clock, path: Path) -> None:
        super().__init__(settings, clock)
        self._path = path
        self._capture: cv2.VideoCapture | None = None
        self._pace: Pace | None = None

    def open(self) -> None:
        self.close()
        if not self._path.is_file():
            raise ConfigError(f"[camera] source: {self._path}: no such file")
        capture = cv2.VideoCapture(str(self._path), cv2.CAP_FFMPEG)
        if not capture.isOpened():
            capture.release()
            raise ConfigError(f"[camera] source: {self._path}: not a video that can be read")
        self._capture = capture
        own_fps = capture.get(cv2.CAP_PROP_FPS)
        low, high = _SENSIBLE_FPS
        fps = own_fps if low <= own_fps <= high else self.settings.fps
        self._pace = Pace(fps, self.clock.now_ns())

    def read(self, timeout_s: float) -> Frame:
        if self._capture is None or self._pace is None:
            raise CameraError(f"camera {self.name}: not open")
        if self.settings.realtime:
            self._wait(self._pace.wait_s(self.clock.now_ns()))
            for _ in range(self._pace.late_pictures(self.clock.now_ns())):
                if not self._capture.grab():
                    break
                self._pace.step()
        whole, image = self._capture.read()
        if not whole:
            self._start_again()
            whole, image = self._capture.read()
            if not whole:
                raise CameraError(f"camera {self.name}: no picture can be read from {self._path}")
        due_ns = self._pace.step()
        captured_ns = due_ns if self.settings.realtime else self.clock.now_ns()
        return self._frame(np.asarray(image, np.uint8), captured_ns)

    def _start_again(self) -> None:
        if not self.settings.loop:
            raise CameraEndedError(f"camera {self.name}: the video is over")
        self.open()

    def close(self) -> None:
        if self._capture is not None:
            self._capture.release()
            self._capture = None
