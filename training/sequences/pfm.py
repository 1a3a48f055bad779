"""Portable float maps, the format in which AirSim records depth: rows from the bottom up."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from training.errors import TrainingDataError
from training.sequences.errors import BrokenFrameError

_HEADER = re.compile(rb"P([fF])\s+(\d+)\s+(\d+)\s+([-+]?[0-9]*\.?[0-9]+(?:[eE][-+]?\d+)?)[ \t\r]*\n")
_HEADER_BYTES = 128
_MAX_SIDE = 16384


def read_pfm(path: Path) -> NDArray[np.float32]:
    """(H, W) float32 map of a one-channel PFM file, top row first.

    The scale's sign says the byte order (negative: little endian); its size is ignored, as AirSim does.

    Raises:
        BrokenFrameError: missing, no PFM header, three channels, or not exactly as long as its header says.
    """
    try:
        content = path.read_bytes()
    except OSError as error:
        raise BrokenFrameError(f"cannot read the depth map {path}: {error.strerror}") from error
    header = _HEADER.match(content[:_HEADER_BYTES])
    if header is None:
        raise BrokenFrameError(f"{path} is not a portable float map: it begins with {content[:16]!r}")
    kind, width, height, scale = header[1], int(header[2]), int(header[3]), float(header[4])
    if kind == b"F":
        raise BrokenFrameError(f"{path} has three channels: a depth map (Pf) has one")
    if not (1 <= width <= _MAX_SIDE and 1 <= height <= _MAX_SIDE) or scale == 0.0:
        raise BrokenFrameError(
            f"{path} says {width} x {height} pixels and scale {scale:g}: sides from 1 to {_MAX_SIDE} and a "
            "scale other than 0 are needed"
        )
    pixels = content[header.end() :]
    if len(pixels) != 4 * width * height:
        raise BrokenFrameError(
            f"{path} holds {len(pixels)} bytes of pixels: {width} x {height} need {4 * width * height}"
        )
    rows = np.frombuffer(pixels, "<f4" if scale < 0 else ">f4").reshape(height, width)
    return np.ascontiguousarray(rows[::-1], dtype=np.float32)


def write_pfm(path: Path, values: NDArray[np.float32]) -> None:
    """Write a (H, W) map as a little-endian one-channel PFM file.

    Raises:
        TrainingDataError: not two-dimensional, or empty.
    """
    if values.ndim != 2 or values.size == 0:
        raise TrainingDataError(f"a map of shape {values.shape} is no PFM picture: (height, width) is needed")
    height, width = values.shape
    rows = np.ascontiguousarray(values[::-1], dtype="<f4")
    path.write_bytes(f"Pf\n{width} {height}\n-1.0\n".encode("ascii") + rows.tobytes())
