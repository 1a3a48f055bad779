"""The coverage picture: where corners were seen, and by how much the camera misses them."""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from uavdepth.calibration.coverage import GRID, Coverage
from uavdepth.calibration.solve import Calibration

_WIDTH_PX = 1200
_CAPTION_PX = 74
_BACKGROUND_BGR = (32, 28, 26)
_CELL_BGR = (58, 50, 46)
_EMPTY_BGR = (60, 60, 150)
_GRID_BGR = (90, 80, 74)
_TEXT_BGR = (235, 235, 235)
_ARROW_PX = 22.0
"""An error of the root mean square is drawn so long."""

_FULL_SCALE = 2.0
"""Errors of so many times the root mean square and more are drawn in the lightest colour."""

_HATCH_PX = 16
_FONT = cv2.FONT_HERSHEY_SIMPLEX


def draw_coverage(calibration: Calibration, coverage: Coverage) -> NDArray[np.uint8]:
    """Corners as dots and their errors as arrows from where the camera expects them; lighter = larger error.

    Cells of the picture without a corner are hatched in red. Arrows are longer than the errors; how much
    stands in the caption.

    Args:
        calibration, coverage: of the same pictures.

    Returns:
        (H, 1200, 3) uint8 BGR.
    """
    camera = calibration.camera
    scale = _WIDTH_PX / camera.width
    picture = np.full((max(1, round(camera.height * scale)), _WIDTH_PX, 3), _CELL_BGR, np.uint8)
    _draw_cells(picture, coverage)
    rms_px = max(calibration.rms_px, 1e-6)
    longer = _ARROW_PX / (rms_px * scale)
    for solved in calibration.views:
        expected = solved.view.pixels - solved.error_px
        lengths = np.linalg.norm(solved.error_px, axis=1)
        colors = _colors(lengths / (_FULL_SCALE * rms_px))
        for at, error, color in zip(expected, solved.error_px, colors, strict=True):
            begin, end = _drawn(at, scale), _drawn(at + longer * error, scale)
            cv2.arrowedLine(picture, begin, end, color, 1, cv2.LINE_AA, 0, 0.25)
            cv2.circle(picture, begin, 2, color, -1, cv2.LINE_AA)
    lines = (
        f"{camera.width}x{camera.height}, {len(calibration.views)} pictures, "
        f"error {calibration.rms_px:.2f} px, "
        f"corners in {coverage.share:.0%} of the picture",
        f"lighter = larger error, white from {_FULL_SCALE * rms_px:.2f} px; "
        f"arrows {longer:.0f} times as long; "
        "hatched: no corners seen",
    )
    return np.vstack([picture, _caption(lines)])


def _drawn(at: NDArray[np.float64], scale: float) -> tuple[int, int]:
    """Place in the drawing of a pixel in the camera's picture (pixel centres at whole numbers in both)."""
    x, y = (at + 0.5) * scale - 0.5
    return round(float(x)), round(float(y))


def _draw_cells(picture: NDArray[np.uint8], coverage: Coverage) -> None:
    height, width = picture.shape[:2]
    columns, rows = GRID
    for row in range(rows):
        for column in range(columns):
            left, right = column * width // columns, (column + 1) * width // columns
            top, bottom = row * height // rows, (row + 1) * height // rows
            cell = picture[top:bottom, left:right]
            if coverage.counts[row, column] == 0:
                _hatch(cell)
            cell[0, :] = cell[:, 0] = _GRID_BGR


def _hatch(cell: NDArray[np.uint8]) -> None:
    y, x = np.indices(cell.shape[:2])
    cell[(x + y) % _HATCH_PX < 3] = _EMPTY_BGR


def _colors(shares: NDArray[np.float64]) -> list[tuple[int, int, int]]:
    """BGR of errors as a share of the full scale."""
    levels = np.clip(shares * 255, 0, 255).astype(np.uint8)
    # The lowest part of the map is as dark as the background.
    lifted = (70 + levels.astype(np.float64) * (255 - 70) / 255).astype(np.uint8)
    mapped = cv2.applyColorMap(lifted[:, None], cv2.COLORMAP_INFERNO)[:, 0]
    return [(int(blue), int(green), int(red)) for blue, green, red in mapped]


def _caption(lines: tuple[str, ...]) -> NDArray[np.uint8]:
    bar = np.full((_CAPTION_PX, _WIDTH_PX, 3), _BACKGROUND_BGR, np.uint8)
    for number, line in enumerate(lines):
        (width, _), _ = cv2.getTextSize(line, _FONT, 0.7, 1)
        fit = 0.7 * min(1.0, (_WIDTH_PX - 24) / width)
        at = (12, math.ceil(28 + 30 * number))
        cv2.putText(bar, line, at, _FONT, fit, _TEXT_BGR, 1, cv2.LINE_AA)
    return bar
