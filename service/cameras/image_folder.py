"""A folder of pictures, played in the order of their names."""

from __future__ import annotations

import re
from pathlib import Path

import cv2
import numpy as np

from service.cameras.camera import Camera, CameraEndedError
from service.cameras.pace import Pace
from service.clock import Clock
from service.errors import CameraError, ConfigError
from service.frame import Frame
from service.settings.camera import CameraSettings

PICTURE_SUFFIXES = frozenset({".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".webp"})


class ImageFolderCamera(Camera):
    """The pictures of a folder at `fps`.

    Args:
        folder: where they lie.
    """

    def __init__(self, settings: CameraSettings, clock: Clock, folder: Path) -> None:
        super().__init__(settings, clock)
        self._folder = folder
        self._paths: list[Path] = []
        self._next = 0
        self._pace: Pace | None = None

    def open(self) -> None:
        if not self._folder.is_dir():
            raise ConfigError(f"[camera] source: {self._folder}: no such folder")
        found = (path for path in self._folder.iterdir() if path.suffix.lower() in PICTURE_SUFFIXES)
        self._paths = sorted(found, key=natural_order)
        if not self._paths:
            raise ConfigError(
                f"[camera] source: {self._folder}: no pictures in it ({', '.join(sorted(PICTURE_SUFFIXES))})"
            )
        self._next = 0
        self._pace = Pace(self.settings.fps, self.clock.now_ns())

    def read(self, timeout_s: float) -> Frame:
        if self._pace is None:
            raise CameraError(f"camera {self.name}: not open")
        if self.settings.realtime:
            self._wait(self._pace.wait_s(self.clock.now_ns()))
            late = self._pace.late_pictures(self.clock.now_ns())
            for _ in range(min(late, len(self._paths) - 1 - self._next)):
                self._next += 1
                self._pace.step()
        if self._next >= len(self._paths):
            if not self.settings.loop:
                raise CameraEndedError(f"camera {self.name}: the pictures are over")
            self._next = 0
        path = self._paths[self._next]
        self._next += 1
        image = cv2.imread(str(path), cv2.IMREAD_COLOR)
        due_ns = self._pace.step()
        if image is None:
            raise CameraError(f"camera {self.name}: {path.name} is not a picture that can be read")
        captured_ns = due_ns if self.settings.realtime else self.clock.now_ns()
        return self._frame(np.asarray(image, np.uint8), captured_ns)

    def close(self) -> None:
        self._pace = None


def natural_order(path: Path) -> list[tuple[int, str]]:
    """Sort key under which picture 10 comes after picture 9."""
    return [
        (int(part), "") if part.isdigit() else (-1, part) for part in re.split(r"(\d+)", path.name.lower())
    ]
