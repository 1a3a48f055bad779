"""Which pictures from the network are handed to a browser: small ones that are what they claim to be."""

from __future__ import annotations

import struct
from typing import Final

from service.ground.errors import PictureError

MAX_PICTURE_BYTES: Final = 2_000_000
"""A 1280x640 JPEG has 400 kB, a lossless 1280x640 log-depth PNG less."""

MAX_SIDE: Final = 4096

_PNG_START = b"\x89PNG\r\n\x1a\n\x00\x00\x00\rIHDR"
_PNG_HEADER_BYTES = 26
_PNG_GREY = 0

_JPEG_START = b"\xff\xd8"
_SIZE_MARKERS = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
"""Start of frame, ITU-T T.81 table B.1."""
_BARE_MARKERS = frozenset({0x01, *range(0xD0, 0xD8)})
"""Markers without a length."""
_SCAN_MARKER = 0xDA
_MAX_SEGMENTS = 200


def check_jpeg(data: bytes, max_bytes: int = MAX_PICTURE_BYTES) -> tuple[int, int]:
    """Width and height of a JPEG by its header.

    Args:
        data: need not be trusted.
        max_bytes: more are refused.

    Raises:
        PictureError: no JPEG, one without a size, or one that is too large.
    """
    _check_bytes(data, max_bytes)
    if not data.startswith(_JPEG_START):
        raise PictureError(f"the picture starts with {data[:4]!r}: no JPEG")
    at = len(_JPEG_START)
    for _ in range(_MAX_SEGMENTS):
        if at + 4 > len(data) or data[at] != 0xFF:
            break
        marker = data[at + 1]
        if marker == 0xFF:
            at += 1
            continue
        if marker in _BARE_MARKERS:
            at += 2
            continue
        if marker == _SCAN_MARKER:
            break
        (length,) = struct.unpack_from(">H", data, at + 2)
        if marker in _SIZE_MARKERS:
            if length < 8 or at + 9 > len(data):
                break
            height, width = struct.unpack_from(">HH", data, at + 5)
            return _check_size(width, height)
        at += 2 + max(length, 2)
    raise PictureError(f"a JPEG of {len(data)} bytes does not tell its size")


def check_grey_png(data: bytes) -> tuple[int, int]:
    """Width and height of an 8-bit grey PNG by its header.

    Raises:
        PictureError: no PNG, another kind of PNG, or one that is too large.
    """
    _check_bytes(data, MAX_PICTURE_BYTES)
    if len(data) < _PNG_HEADER_BYTES or not data.startswith(_PNG_START):
        raise PictureError(f"the picture starts with {data[:8]!r}: no PNG")
    width, height, bits, kind = struct.unpack_from(">IIBB", data, len(_PNG_START))
    if (bits, kind) != (8, _PNG_GREY):
        raise PictureError(f"the PNG has {bits} bits and colour type {kind}: 8-bit grey (0) is needed")
    return _check_size(width, height)


def _check_bytes(data: bytes, max_bytes: int) -> None:
    if len(data) > max_bytes:
        raise PictureError(f"a picture of {len(data)} bytes: at most {max_bytes} are shown")


def _check_size(width: int, height: int) -> tuple[int, int]:
    if not (1 <= width <= MAX_SIDE and 1 <= height <= MAX_SIDE):
        raise PictureError(f"a picture of {width}x{height} pixels: 1x1 to {MAX_SIDE}x{MAX_SIDE} are shown")
    return width, height
