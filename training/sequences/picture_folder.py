"""A folder of pictures in the order of their names."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from training.errors import TrainingDataError
from training.sequences.calibration import NO_CALIBRATION, Calibration
from training.sequences.camera_file import read_camera
from training.sequences.frame_sequence import file_problem
from training.sequences.pictures import PICTURE_SUFFIXES, read_picture, require_size
from training.sequences.rectifier import Rectifier
from uavdepth.camera import CameraModel

CAMERA_FILES = ("camera.json", "camera.toml")


@dataclass(frozen=True)
class PictureFolder:
    """A `FrameSequence` of pictures without any truth.

    Args:
        name: of the folder.
        lens: the camera as calibrated.
        pictures: in order.
        rectifier: takes the lens's distortion out.
    """

    name: str
    lens: CameraModel
    pictures: tuple[Path, ...]
    rectifier: Rectifier

    @property
    def camera(self) -> CameraModel:
        """Of the rectified pictures."""
        return self.rectifier.camera

    def __len__(self) -> int:
        return len(self.pictures)

    def file_of(self, index: int) -> Path:
        """The picture."""
        return self.pictures[index]

    def problem(self, index: int) -> str | None:
        """A missing or empty picture."""
        return file_problem(self.pictures[index])

    def image_bgr(self, index: int) -> NDArray[np.uint8]:
        """(H, W, 3) rectified picture. Raises BrokenFrameError: missing, unreadable or of another size."""
        picture = read_picture(self.pictures[index])
        require_size(self.pictures[index], picture.shape[:2], self.lens)
        return self.rectifier.apply(picture)

    def truth_m(self, index: int) -> NDArray[np.float32] | None:
        """None: nothing is known."""
        return None


def open_folder(root: Path, calibration: Calibration = NO_CALIBRATION) -> list[PictureFolder]:
    """The pictures in a folder, or those of each of its sub-folders; `2.png` comes before `10.png`.

    Args:
        root: the folder; a `camera.json` or `camera.toml` in a folder of pictures is its calibration.
        calibration: of folders without one.

    Raises:
        TrainingDataError: no pictures, no calibration, or one for pictures of another size.
    """
    if not root.is_dir():
        raise TrainingDataError(f"no folder of pictures at {root}")
    folders = [root, *sorted(path for path in root.iterdir() if path.is_dir())]
    found = [(folder, pictures) for folder in folders if (pictures := _pictures(folder))]
    if not found:
        raise TrainingDataError(f"no pictures ({', '.join(PICTURE_SUFFIXES)}) in {root} or its sub-folders")
    if found[0][0] == root:
        found = found[:1]
    return [_open_pictures(folder, pictures, calibration) for folder, pictures in found]


def _open_pictures(folder: Path, pictures: tuple[Path, ...], calibration: Calibration) -> PictureFolder:
    described = next((folder / name for name in CAMERA_FILES if (folder / name).is_file()), None)
    if described is not None:
        calibration = Calibration(read_camera(described))
    first = next((path for path in pictures if file_problem(path) is None), pictures[0])
    lens = calibration.of(first)
    return PictureFolder(folder.name, lens, pictures, Rectifier(lens))


def _pictures(folder: Path) -> tuple[Path, ...]:
    paths = (path for path in folder.iterdir() if path.suffix.lower() in PICTURE_SUFFIXES)
    return tuple(sorted(paths, key=lambda path: _by_number(path.name)))


def _by_number(name: str) -> list[tuple[int, str]]:
    """Sorts runs of digits by their value."""
    return [(int(part), "") if part.isdigit() else (-1, part) for part in re.split(r"([0-9]+)", name)]
