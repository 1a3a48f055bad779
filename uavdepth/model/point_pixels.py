"""Measured points at the pixels of the network's picture, in its own unit of inverse depth."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class PointPixels:
    """Points by rows of the picture, no two at one pixel; every array is (N,).

    Args:
        width, height: of the picture, pixels.
        row, column: integers, the points' pixels.
        q: float32 inverse depth as in `uavdepth.model.hint_planes`, above 0.
        confidence: float32 in it, above 0 and at most 1.
    """

    width: int
    height: int
    row: NDArray[np.intp]
    column: NDArray[np.intp]
    q: NDArray[np.float32]
    confidence: NDArray[np.float32]

    @classmethod
    def none(cls, width: int, height: int) -> PointPixels:
        """No points."""
        nowhere, nothing = np.zeros(0, np.intp), np.zeros(0, np.float32)
        return cls(width, height, nowhere, nowhere, nothing, nothing)

    @classmethod
    def of_planes(cls, planes: NDArray[np.float32]) -> PointPixels:
        """From (2, height, width) q and confidence, 0 where there is no point."""
        row, column = np.nonzero((planes[0] > 0) & (planes[1] > 0))
        q, confidence = planes[:, row, column]
        return cls(planes.shape[2], planes.shape[1], row, column, q, confidence)

    @property
    def planes(self) -> NDArray[np.float32]:
        """(2, height, width) float32 q and confidence, 0 where there is no point."""
        planes = np.zeros((2, self.height, self.width), dtype=np.float32)
        planes[0, self.row, self.column] = self.q
        planes[1, self.row, self.column] = self.confidence
        return planes

    def __len__(self) -> int:
        return len(self.row)

    def cells(self, width: int, height: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Row and column of the points in a picture of another size."""
        return self.row * height // self.height, self.column * width // self.width

    def sampled(self, plane: NDArray[np.float32]) -> NDArray[np.float32]:
        """(N,) float32 values at the points of a map of the picture, bilinear where its size is another."""
        height, width = plane.shape
        if (width, height) == (self.width, self.height) or not len(self):
            return plane[self.row, self.column]
        x = (self.column + 0.5) * (width / self.width) - 0.5
        y = (self.row + 0.5) * (height / self.height) - 0.5
        columns, rows = np.asarray(x[:, None], np.float32), np.asarray(y[:, None], np.float32)
        values = cv2.remap(plane, columns, rows, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        return np.asarray(values, np.float32)[:, 0]
