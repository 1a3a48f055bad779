"""Where in the picture corners were seen: there, and not elsewhere, the lens is known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavdepth.calibration.solve import Calibration

GRID = (8, 6)
"""Columns and rows of cells."""

_CORNER = 0.22
"""Of width and height: how much of the picture is one of its corners. The outer square of a board and its
margin keep inner corners off the very edge."""


@dataclass(frozen=True)
class Coverage:
    """How the corners lie in the picture.

    Args:
        counts: (rows, columns) int64 corners in each cell of `GRID`.
        empty_corners: corners of the picture in which none was seen, in words.
    """

    counts: NDArray[np.int64]
    empty_corners: tuple[str, ...]

    @property
    def share(self) -> float:
        """Share of cells with corners."""
        return float(np.mean(self.counts > 0))


def cover(calibration: Calibration) -> Coverage:
    """Where the corners of the used pictures lie."""
    width, height = calibration.camera.width, calibration.camera.height
    pixels = np.concatenate([solved.view.pixels for solved in calibration.views]).astype(np.float64)
    # Pixel centres are whole numbers, so the picture reaches from -0.5 to width - 0.5.
    place = (pixels + 0.5) / (width, height)
    columns, rows = GRID
    counts, _, _ = np.histogram2d(place[:, 1], place[:, 0], bins=(rows, columns), range=((0, 1), (0, 1)))
    empty = [
        f"{vertical} {horizontal}"
        for vertical, y in (("top", place[:, 1]), ("bottom", 1 - place[:, 1]))
        for horizontal, x in (("left", place[:, 0]), ("right", 1 - place[:, 0]))
        if not np.any((x < _CORNER) & (y < _CORNER))
    ]
    return Coverage(counts.astype(np.int64), tuple(empty))
