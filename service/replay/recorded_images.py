"""Pictures out of a record's messages, from bytes that need not be trusted."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from service.errors import RecordError
from service.ground.errors import PictureError
from service.ground.pictures import check_jpeg
from service.recorder.sigma_codes import sigma_of_codes
from service.replay.protobuf_fields import protobuf_fields

_MAX_PIXELS = 4096 * 4096
_MAX_PICTURE_BYTES = 3 * _MAX_PIXELS
_IMAGE_DATA = 2
_RAW_WIDTH, _RAW_HEIGHT, _RAW_ENCODING, _RAW_STEP, _RAW_DATA = 2, 3, 4, 5, 6


def image_of(data: bytes) -> NDArray[np.uint8]:
    """(H, W, 3) uint8 picture of a `foxglove.CompressedImage`.

    Raises:
        RecordError: it holds no picture.
    """
    jpeg = protobuf_fields(data).get(_IMAGE_DATA)
    if not isinstance(jpeg, bytes) or not jpeg:
        raise RecordError("a recorded picture is empty")
    try:
        # OpenCV takes 10 s and gigabytes for a few hundred bytes that claim to be huge.
        check_jpeg(jpeg, _MAX_PICTURE_BYTES)
        image = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR)
    except PictureError as error:
        raise RecordError(f"a recorded picture cannot be decoded: {error}") from error
    except cv2.error as error:
        raise RecordError(f"a recorded picture cannot be decoded: {error.err}") from error
    if image is None:
        raise RecordError("a recorded picture cannot be decoded")
    return np.asarray(image, np.uint8)


def depth_of(data: bytes) -> NDArray[np.float32]:
    """(H, W) float32 metres of a `foxglove.RawImage` in 16UC1 millimetres, NaN where it is 0.

    Raises:
        RecordError: it is no such picture.
    """
    millimetres = _raw_image(data, "16UC1", np.dtype("<u2"))
    return np.where(millimetres == 0, np.nan, millimetres / 1000.0).astype(np.float32)


def sigma_of(data: bytes) -> NDArray[np.float32]:
    """(H, W) float32 standard deviations over depth of a `foxglove.RawImage` in the codes of `sigma_codes`.

    Raises:
        RecordError: it is no such picture.
    """
    return sigma_of_codes(_raw_image(data, "8UC1", np.dtype(np.uint8)))


def _raw_image(data: bytes, wanted: str, pixel: np.dtype[Any]) -> NDArray[Any]:
    fields = protobuf_fields(data)
    width, height, step = fields.get(_RAW_WIDTH, 0), fields.get(_RAW_HEIGHT, 0), fields.get(_RAW_STEP, 0)
    encoding, packed = fields.get(_RAW_ENCODING, b""), fields.get(_RAW_DATA, b"")
    if not (isinstance(width, int) and isinstance(height, int) and isinstance(packed, bytes)):
        raise RecordError("a recorded depth picture is damaged")
    row = pixel.itemsize * width
    if encoding != wanted.encode() or not 0 < width * height <= _MAX_PIXELS or step != row:
        raise RecordError(f"a recorded depth picture is {width}x{height} of {encoding!r}: {wanted} is needed")
    if len(packed) != step * height:
        raise RecordError(f"a recorded depth picture has {len(packed)} bytes: {step * height} are needed")
    return np.frombuffer(packed, pixel).reshape(height, width)
