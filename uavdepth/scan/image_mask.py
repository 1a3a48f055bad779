"""Parts of the picture that the camera must not be asked about: landing legs, propellers, a frame."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from uavdepth.camera import CameraModel
from uavdepth.errors import ImageMaskError

_LIGHT = 128
"""Pixels darker than this are masked: pictures saved with losses have no pure black."""

_MOST_BYTES = 64 * 1024 * 1024


def load_image_mask(path: str | Path, camera: CameraModel) -> NDArray[np.bool_]:
    """Read a mask: white is looked at, black is not.

    Draw it generously: a network smears the edge of a leg over some pixels.

    Args:
        path: a PNG or another picture that OpenCV reads, of the camera's size. What is transparent counts by
            its colour.
        camera: whose pictures it is laid over, undistortion and all: pixel for pixel.

    Returns:
        (H, W) bool, True where the picture is not to be looked at.

    Raises:
        ImageMaskError: a file that is missing or no picture, a picture of another size than the camera's, or
            one that masks everything.
    """
    file = Path(path)
    try:
        size = file.stat().st_size
        if size > _MOST_BYTES:
            raise ImageMaskError(f"mask {file} has {size} bytes: at most {_MOST_BYTES} are read")
        data = file.read_bytes()
    except OSError as error:
        raise ImageMaskError(f"mask {file} cannot be read: {error.strerror or error}") from error
    picture = None
    if data:
        try:
            picture = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_GRAYSCALE)
        except cv2.error:
            picture = None
    if picture is None:
        raise ImageMaskError(
            f"mask {file} is no picture that OpenCV reads: a PNG, white and black, is needed"
        )
    height, width = picture.shape[:2]
    if (width, height) != (camera.width, camera.height):
        raise ImageMaskError(
            f"mask {file} is {width}x{height} pixels, the camera is {camera.width}x{camera.height}"
        )
    masked = np.asarray(picture < _LIGHT, dtype=np.bool_)
    if masked.all():
        raise ImageMaskError(f"mask {file} is black everywhere: white is needed where the camera may look")
    return masked
