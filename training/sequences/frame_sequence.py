"""What every reader gives: consecutive frames of one calibrated camera."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from uavdepth.camera import CameraModel


class FrameSequence(Protocol):
    """Consecutive frames of one undistorted camera, numbered from 0."""

    @property
    def name(self) -> str:
        """What it is called in lists and split files."""
        ...

    @property
    def camera(self) -> CameraModel:
        """Intrinsics of every picture, without distortion."""
        ...

    def __len__(self) -> int: ...

    def file_of(self, index: int) -> Path:
        """The file that holds the picture of a frame."""
        ...

    def problem(self, index: int) -> str | None:
        """Why a frame cannot be used, as far as that is known without decoding it; None if nothing is."""
        ...

    def image_bgr(self, index: int) -> NDArray[np.uint8]:
        """(H, W, 3) picture. Raises BrokenFrameError: missing, unreadable or of another size."""
        ...

    def truth_m(self, index: int) -> NDArray[np.float32] | None:
        """(H, W) z-depth in metres at the picture's own size, NaN without truth, +inf sky; None without any.

        Raises:
            BrokenFrameError: there is a depth file, but it is unreadable or of another size.
        """
        ...


class PosedSequence(FrameSequence, Protocol):
    """A sequence whose recording says where the camera was."""

    def world_from_camera(self, index: int) -> NDArray[np.float64]:
        """(4, 4) pose of the camera (x right, y down, z forward), metres, in the recording's own world."""
        ...


@runtime_checkable
class StreamedSequence(FrameSequence, Protocol):
    """A sequence that is decoded in order, such as a video: single frames come at the price of all before."""

    def images_bgr(self) -> Iterator[NDArray[np.uint8]]:
        """All pictures in order. Raises BrokenFrameError: one is unreadable or of another size."""
        ...


def file_problem(path: Path) -> str | None:
    """What is wrong with a file as far as its directory entry tells; None if nothing is."""
    try:
        size = path.stat().st_size
    except OSError as error:
        return error.strerror or str(error)
    return "empty file" if size == 0 else None
