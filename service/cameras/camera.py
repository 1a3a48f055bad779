"""What every camera does: open, deliver pictures of the calibrated size with their capture stamps, close."""

from __future__ import annotations

import threading
from abc import ABC, abstractmethod

import cv2
import numpy as np
from numpy.typing import NDArray

from service.clock import Clock
from service.errors import CameraError
from service.frame import Frame
from service.settings.camera import CameraSettings

_ASPECT_TOLERANCE = 0.005
"""Relative difference of width over height up to which two pictures are the same view in two sizes."""


class CameraTimeoutError(CameraError):
    """No picture came in time."""


class CameraEndedError(CameraError):
    """A file has no more pictures."""


class PictureSizeError(CameraError):
    """A picture whose size is not the calibrated one: every distance taken from it would be wrong."""


class Camera(ABC):
    """One source of pictures. Used by one thread; `interrupt` may come from another.

    Args:
        settings: `[camera]`.
        clock: gives the capture stamps.
    """

    reopen_on_timeout = True
    """Whether a camera that delivers nothing is worth closing and opening again."""

    has_noise = False
    """Whether two of its pictures are never the same, so that the same one again means that it hangs."""

    stands_back = False
    """Whether its thread computes, so that the flight path goes first where processors are few."""

    def __init__(self, settings: CameraSettings, clock: Clock) -> None:
        self.settings = settings
        self.clock = clock
        self._index = 0
        self._interrupted = threading.Event()

    @property
    def name(self) -> str:
        """The camera as the user wrote it, for messages."""
        return self.settings.source

    @property
    def granted(self) -> str:
        """What the open device says it delivers, in words; empty where there is nothing to say."""
        return ""

    @abstractmethod
    def open(self) -> None:
        """Start to deliver.

        Raises:
            CameraError: it is not there or does not answer; trying again may help.
            ConfigError: it can never work; trying again does not help.
        """

    @abstractmethod
    def read(self, timeout_s: float) -> Frame:
        """The next picture.

        Args:
            timeout_s: longest wait where the source can be bounded, seconds.

        Raises:
            CameraTimeoutError: none came in time.
            CameraEndedError: a file is over.
            PictureSizeError: it came in a size that is not the calibrated one.
            CameraError: the camera is lost.
        """

    @abstractmethod
    def close(self) -> None:
        """Let go of the device. May be called at any time, also twice."""

    def interrupt(self) -> None:
        """Wake a `read` that waits, for good."""
        self._interrupted.set()

    def _wait(self, seconds: float) -> None:
        """Wait; raises CameraTimeoutError if interrupted meanwhile."""
        if seconds > 0 and self._interrupted.wait(seconds):
            raise CameraTimeoutError(f"camera {self.name}: interrupted")

    def _frame(self, image_bgr: NDArray[np.uint8], captured_ns: int) -> Frame:
        """`image_bgr` as a frame of the calibrated size, stamped with exposure instead of delivery."""
        fitted = fit_picture(image_bgr, self.settings, self.name)
        frame = Frame(fitted, captured_ns - round(self.settings.latency_ms * 1e6), self._index)
        self._index += 1
        return frame


def fit_picture(image: NDArray[np.uint8], settings: CameraSettings, name: str) -> NDArray[np.uint8]:
    """The picture as (H, W, 3) uint8 BGR in the calibrated size.

    Raises:
        PictureSizeError: another size, unless `resize_pictures` is on and the aspect is the same.
    """
    if image.ndim == 2:
        image = np.asarray(cv2.cvtColor(image, cv2.COLOR_GRAY2BGR), np.uint8)
    height, width = image.shape[:2]
    if (width, height) == (settings.width, settings.height):
        return image
    delivered, wanted = f"{width}x{height}", f"{settings.width}x{settings.height}"
    same_aspect = abs(width * settings.height / (height * settings.width) - 1) <= _ASPECT_TOLERANCE
    if not (settings.resize_pictures and same_aspect):
        hint = "the aspect differs, calibrate for this size"
        if same_aspect:
            hint = "set width and height to it, or resize_pictures = true"
        raise PictureSizeError(
            f"[camera] width, height: camera {name} delivers {delivered}, "
            f"the configuration says {wanted}: {hint}"
        )
    resized = cv2.resize(image, (settings.width, settings.height), interpolation=cv2.INTER_AREA)
    return np.asarray(resized, np.uint8)
