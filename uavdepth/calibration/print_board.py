"""The board as a picture to print, with its true size in the file."""

from __future__ import annotations

import struct
import zlib

import cv2
import numpy as np
from numpy.typing import NDArray

from uavdepth.calibration.board import Board
from uavdepth.errors import CalibrationError

_INCH_M = 0.0254
_PIXELS_AT_MOST = 16384
_SQUARE_PX_AT_LEAST = 60
_DPI = 300.0
_PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_HEADER_END = len(_PNG_SIGNATURE) + 4 + 4 + 13 + 4


def board_png(board: Board) -> bytes:
    """A PNG file that prints the board in its true size: the resolution stands in its pHYs chunk.

    Around the squares lies a white margin of one square, which the detectors need, and below them the
    size in words, to be held against a ruler.

    Raises:
        CalibrationError: the board is too large for a picture of 16384 pixels.
    """
    # A whole number of pixels a square keeps every edge sharp; the resolution absorbs the rounding.
    square_px = max(_SQUARE_PX_AT_LEAST, round(board.square_m / _INCH_M * _DPI))
    if (max(board.columns, board.rows) + 2) * square_px > _PIXELS_AT_MOST:
        square_px = _PIXELS_AT_MOST // (max(board.columns, board.rows) + 2)
    if square_px < _SQUARE_PX_AT_LEAST:
        raise CalibrationError(f"board: {board.columns}x{board.rows} squares are too many to draw")
    squares = board.draw(square_px)
    page = np.pad(squares, square_px, constant_values=255)
    for line, text in enumerate(size_words(board)):
        _write(page, text, square_px, line)
    return _with_resolution(page, square_px / board.square_m)


def size_words(board: Board) -> tuple[str, str]:
    """What board it is, and what a ruler must read on the print."""
    width_m, height_m = board.size_m
    return (
        f"uavdepth: {board.name}",
        f"Print at 100 %, without fitting to the page: the squares together measure "
        f"{width_m * 1e3:g} x {height_m * 1e3:g} mm",
    )


def _write(page: NDArray[np.uint8], text: str, margin_px: int, line: int) -> None:
    font = cv2.FONT_HERSHEY_SIMPLEX
    (width, height), _ = cv2.getTextSize(text, font, 1.0, 1)
    scale = min((page.shape[1] - margin_px) / width, margin_px / 5 / height)
    y = page.shape[0] - margin_px + round(margin_px * (0.45 + 0.35 * line))
    cv2.putText(page, text, (margin_px // 2, y), font, scale, 90, max(1, round(2 * scale)), cv2.LINE_AA)


def _with_resolution(page: NDArray[np.uint8], pixels_per_m: float) -> bytes:
    written, encoded = cv2.imencode(".png", page)
    if not written:
        raise CalibrationError(f"board: a picture of {page.shape[1]}x{page.shape[0]} cannot be encoded")
    data = encoded.tobytes()
    # PNG 11.3.4.3: pixels per unit in x and y, unit 1 is the metre; it must stand before the pixels.
    body = b"pHYs" + struct.pack(">IIB", round(pixels_per_m), round(pixels_per_m), 1)
    chunk = struct.pack(">I", len(body) - 4) + body + struct.pack(">I", zlib.crc32(body))
    return data[:_HEADER_END] + chunk + _without_resolution(data[_HEADER_END:])


def _without_resolution(chunks: bytes) -> bytes:
    """The chunks but those named pHYs: a PNG may hold only one."""
    kept, at = [], 0
    while at < len(chunks):
        end = at + 12 + int(struct.unpack(">I", chunks[at : at + 4])[0])
        if chunks[at + 4 : at + 8] != b"pHYs":
            kept.append(chunks[at:end])
        at = end
    return b"".join(kept)
