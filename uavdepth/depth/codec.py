"""Depth as an 8-bit picture: logarithmic codes in a PNG that any browser can show."""

from __future__ import annotations

import math
import struct
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from uavdepth.errors import DepthCodecError

INVALID_CODE = 0
"""Depth unknown: NaN, zero or negative."""

NEARER_CODE = 1
"""Valid, but nearer than near_m; decoded as 0 m, since nothing more is known that is not too far."""

FAR_CODE = 255
"""At far_m or beyond, sky included; decoded as far_m."""

_FIRST_LEVEL = NEARER_CODE + 1
_LEVELS = FAR_CODE - _FIRST_LEVEL
"""253 logarithmic levels from near_m up to far_m: 2.5 % a level from 0.2 to 100 m."""

_MAX_PIXELS = 16_777_216
_PNG_START = b"\x89PNG\r\n\x1a\n\x00\x00\x00\rIHDR"

_PNG_OPTIONS = (cv2.IMWRITE_PNG_COMPRESSION, 1, cv2.IMWRITE_PNG_STRATEGY, cv2.IMWRITE_PNG_STRATEGY_RLE)
"""Measured: smaller and faster than every compression level with the default strategy."""


def encode_depth_png(depth_m: NDArray[np.floating], near_m: float, far_m: float) -> bytes:
    """8-bit log-depth PNG. Levels are rounded down: a decoded depth never exceeds the encoded one.

    Args:
        depth_m: (H, W) depth in metres; NaN, zero and negative are stored as invalid, +inf as far.
        near_m, far_m: span of the levels, 0 < near_m, 2 * near_m <= far_m. They are not stored in
            the PNG and must travel with it (`DepthPictureInfo`).

    Raises:
        DepthCodecError: an impossible span, or a depth that is not a two-dimensional array of numbers.
    """
    return encode_codes_png(depth_codes(depth_m, near_m, far_m))


def encode_codes_png(codes: NDArray[np.uint8]) -> bytes:
    """The PNG of (H, W) uint8 codes, as `depth_codes` makes them.

    Raises:
        DepthCodecError: codes of another type or shape.
    """
    if codes.dtype != np.uint8 or codes.ndim != 2 or not codes.size:
        raise DepthCodecError(f"codes are {codes.dtype} {codes.shape}: an (H, W) array of uint8 is needed")
    written, data = cv2.imencode(".png", codes, _PNG_OPTIONS)
    if not written:
        raise DepthCodecError(f"OpenCV could not write a PNG of {codes.shape} pixels")
    return data.tobytes()


def decode_depth_png(data: bytes, near_m: float, far_m: float) -> NDArray[np.float32]:
    """Depth in metres of a picture made by `encode_depth_png` with the same span.

    Returns:
        (H, W) float32: NaN where invalid, 0 where nearer than near_m, far_m where far_m or beyond,
        else the lower edge of the level.

    Raises:
        DepthCodecError: data that is not an 8-bit grey PNG, one of more than 16,777,216 pixels, or an
            impossible span.
    """
    edges = depth_code_edges_m(near_m, far_m)
    _check_size(data)
    buffer = np.frombuffer(data, dtype=np.uint8)
    try:
        codes = cv2.imdecode(buffer, cv2.IMREAD_UNCHANGED)
    except cv2.error as error:
        raise DepthCodecError(f"{len(data)} bytes cannot be read as a picture: {error.err}") from error
    if codes is None:
        raise DepthCodecError(f"{len(data)} bytes are not a picture that can be read")
    if codes.dtype != np.uint8 or codes.ndim != 2:
        raise DepthCodecError(f"the picture is {codes.dtype} {codes.shape}: an 8-bit grey one is needed")
    return np.asarray(cv2.LUT(codes, edges), dtype=np.float32)


def _check_size(data: bytes) -> None:
    """Refuse what is no PNG, or claims to be huge, before anything of that size is reserved.

    OpenCV reads other formats too: 700 bytes of JPEG that claim 30,000x30,000 pixels took it 10 s and 1 GB.
    """
    if not data.startswith(_PNG_START) or len(data) < len(_PNG_START) + 8:
        raise DepthCodecError(f"{len(data)} bytes are not a picture that can be read: a PNG is needed")
    width, height = struct.unpack_from(">II", data, len(_PNG_START))
    if width * height > _MAX_PIXELS:
        raise DepthCodecError(f"the picture has {width}x{height} pixels: at most {_MAX_PIXELS} are read")


def depth_codes(depth_m: NDArray[np.floating], near_m: float, far_m: float) -> NDArray[np.uint8]:
    """(H, W) uint8 codes of a depth map: what `encode_depth_png` writes."""
    edges = depth_code_edges_m(near_m, far_m)
    depth = np.asarray(depth_m)
    if depth.ndim != 2 or not depth.size or depth.dtype.kind not in "fiu":
        raise DepthCodecError(f"depth is {depth.dtype} {depth.shape}: an (H, W) array of numbers is needed")
    if depth.dtype != np.float32:
        # A depth between two float32 values must not be rounded up.
        wide = depth.astype(np.float64)
        with np.errstate(over="ignore"):
            depth = wide.astype(np.float32)
        depth = np.where(depth > wide, np.nextafter(depth, np.float32(-np.inf)), depth)

    with np.errstate(invalid="ignore"):
        level = np.minimum(np.maximum(depth, edges[_FIRST_LEVEL]), edges[FAR_CODE])
        level *= np.float32(1.0 / near_m)
        np.log(level, out=level)
        level *= np.float32(_LEVELS / math.log(far_m / near_m))
        # Start a hair high, then step back where the level's own edge is above the depth: exact
        # whatever the rounding of log, so that codes of decoded depths come out the same again.
        level += np.float32(_FIRST_LEVEL + 0.01)
        np.minimum(level, np.float32(FAR_CODE), out=level)
        codes = level.astype(np.uint8)
        codes -= (cv2.LUT(codes, edges) > depth).view(np.uint8)
        # NaN fails the comparison too, so this one test finds everything that is not a depth.
        codes *= (depth > 0).view(np.uint8)
    return np.asarray(codes, dtype=np.uint8)


def depth_code_edges_m(near_m: float, far_m: float) -> NDArray[np.float32]:
    """(256,) float32 lower edge of each code in metres; NaN for the invalid code.

    Raises:
        DepthCodecError: a span that is not finite with 0 < near_m and 2 * near_m <= far_m.
    """
    if not (math.isfinite(near_m) and math.isfinite(far_m) and near_m >= 1e-6 and 2 * near_m <= far_m <= 1e9):
        raise DepthCodecError(
            f"the span is {near_m} to {far_m} m: a near_m of 1e-6 or more "
            "and a far_m of 2 * near_m to 1e9 are needed"
        )
    return _edges(float(near_m), float(far_m))


@lru_cache(maxsize=8)
def _edges(near_m: float, far_m: float) -> NDArray[np.float32]:
    exact = near_m * (far_m / near_m) ** (np.arange(_LEVELS + 1) / _LEVELS)
    rounded = exact.astype(np.float32)
    levels = np.where(rounded > exact, np.nextafter(rounded, np.float32(0)), rounded)
    edges = np.concatenate([[np.nan, 0.0], levels]).astype(np.float32)
    edges.flags.writeable = False
    return edges
