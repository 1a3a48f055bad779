"""Sequences whose frames are one picture file each, all of one camera."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from training.sequences.frame_sequence import file_problem
from training.sequences.pictures import read_calibrated_picture
from uavdepth.camera import CameraModel


@dataclass(frozen=True)
class PictureFiles:
    """What such sequences have in common; depth and poses are each layout's own.

    Args:
        name: of the sequence.
        camera: of the pictures.
        pictures: their files, in order.
    """

    name: str
    camera: CameraModel
    pictures: tuple[Path, ...]

    def __len__(self) -> int:
        return len(self.pictures)

    def file_of(self, index: int) -> Path:
        """The picture."""
        return self.pictures[index]

    def problem(self, index: int) -> str | None:
        """A missing or empty picture."""
        return file_problem(self.pictures[index])

    def image_bgr(self, index: int) -> NDArray[np.uint8]:
        """(H, W, 3) picture. Raises BrokenFrameError: missing, unreadable or of another size."""
        return read_calibrated_picture(self.pictures[index], self.camera)
