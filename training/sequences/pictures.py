"""Pictures from files, checked against their calibration."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from training.errors import TrainingDataError
from training.sequences.errors import BrokenFrameError
from uavdepth.camera import CameraModel

PICTURE_SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp", ".ppm", ".tif", ".tiff", ".webp")


def read_picture(path: Path) -> NDArray[np.uint8]:
    """(H, W, 3) BGR picture of a file; grey pictures become three equal channels.

    Raises:
        BrokenFrameError: missing or not a picture.
    """
    try:
        content = np.fromfile(path, np.uint8)
    except OSError as error:
        raise BrokenFrameError(f"cannot read the picture {path}: {error.strerror}") from error
    return decode_picture(content, path)


def decode_picture(content: NDArray[np.uint8], path: Path) -> NDArray[np.uint8]:
    """(H, W, 3) BGR picture of the bytes of a picture file.

    Args:
        content: the bytes.
        path: where they are from, for the error.

    Raises:
        BrokenFrameError: they are no picture.
    """
    try:
        picture = cv2.imdecode(content, cv2.IMREAD_COLOR) if content.size else None
    except cv2.error as error:
        raise BrokenFrameError(f"cannot decode the picture {path}: {error}") from error
    if picture is None:
        raise BrokenFrameError(f"cannot decode the picture {path} ({content.size} bytes)")
    return np.asarray(picture, np.uint8)


def read_calibrated_picture(path: Path, camera: CameraModel) -> NDArray[np.uint8]:
    """As `read_picture`, of the calibration's size.

    Raises:
        BrokenFrameError: missing, not a picture, or of another size.
    """
    picture = read_picture(path)
    require_size(path, picture.shape[:2], camera)
    return picture


def require_size(path: Path, shape: tuple[int, ...], camera: CameraModel) -> None:
    """Raises BrokenFrameError: `shape` (height, width) is not the camera's."""
    if shape != (camera.height, camera.width):
        raise BrokenFrameError(
            f"{path} is {shape[1]} x {shape[0]} pixels, its calibration is for "
            f"{camera.width} x {camera.height}: give the calibration of these pictures"
        )


def require_first_picture(path: Path, camera: CameraModel) -> None:
    """Say at opening that a calibration belongs to other pictures; a first picture that is broken passes.

    Raises:
        TrainingDataError: the picture is readable and of another size.
    """
    try:
        picture = read_picture(path)
    except BrokenFrameError:
        return
    try:
        require_size(path, picture.shape[:2], camera)
    except BrokenFrameError as error:
        raise TrainingDataError(str(error)) from error
