"""Counting points by direction and distance, and finding the nearest distance that enough of them support."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from uavdepth.scan.obstacle_scan import FIRST_BEARING_DEG, SECTOR_COUNT, SECTOR_WIDTH_DEG

NEAREST_BIN_M = 0.05
"""Everything nearer is counted here: no camera has focus or ground clearance below it."""

SUPPORT_SPAN = 1.2
"""The points that support one distance lie within this ratio: depth on one surface scatters by some
percent, noise by decades."""

NEAR_QUANTILE = 0.03
"""Share of the supporting points that may be nearer than the distance reported."""

LINE_ELEMENTS = 3
"""A line runs through so many neighbouring elements: noise that fills one by chance does not fill three."""

LINE_STEP = 1.35
"""Ratio of its distances in neighbouring elements: it may cross the way at 70 degrees off square."""

_MANTISSA_SHIFT = 17
"""A positive float32 read as an integer grows like its logarithm; dropping 17 of its 23 mantissa bits
leaves 64 bins an octave, each 1.1 to 1.6 % wide, at the cost of one shift."""

_ROWS_TO_FIRST_BEARING = round((FIRST_BEARING_DEG + 180.0) / SECTOR_WIDTH_DEG)
"""Rows of the histogram start straight behind, elements at -155 degrees."""

_PER_RADIAN = np.float32(np.degrees(1.0) / SECTOR_WIDTH_DEG)
_REAR_OFFSET = np.float32(180.0 / SECTOR_WIDTH_DEG + 0.5)


class RangeHistogram:
    """Histogram of 72 directions times logarithmic distances.

    Args:
        max_distance_m: points at or beyond are not for this histogram.
        capacity: most points that it is given between two calls of `clear`.
    """

    def __init__(self, max_distance_m: float, capacity: int) -> None:
        first, last = np.array([NEAREST_BIN_M, max_distance_m], np.float32).view(np.int32) >> _MANTISSA_SHIFT
        self._first_bin = np.int32(first)
        self._bins = int(last - first) + 1
        keys = np.arange(self._bins + 1, dtype=np.int32) + self._first_bin
        self.edges_m: NDArray[np.float32] = (keys << _MANTISSA_SHIFT).view(np.float32)
        """(bins + 1,) float32 lower edges of the distance bins."""
        reach = np.searchsorted(self.edges_m[:-1], self.edges_m[:-1] * np.float32(SUPPORT_SPAN))
        self._window_end = np.minimum(reach, self._bins)
        # Written by `add`, counted at once by `nearest_m`; int64 because bincount would copy all else.
        self._cells = np.zeros(capacity, dtype=np.int64)
        self._doubt = np.zeros(capacity, dtype=np.float32)
        self._doubted = False
        self._used = 0

    def clear(self) -> None:
        """Forget every point."""
        self._used = 0
        self._doubted = False

    def add(
        self,
        forward_m: NDArray[np.float32],
        right_m: NDArray[np.float32],
        range_m: NDArray[np.float32],
        wanted: NDArray[np.bool_],
        shortening: NDArray[np.float32] | None = None,
    ) -> None:
        """Take in points.

        Args:
            forward_m, right_m: (N,) float32 horizontal coordinates in the level frame.
            range_m: (N,) float32 horizontal distance; below max_distance_m where wanted.
            wanted: (N,) bool, the points to count; the values of the others do not matter.
            shortening: (N,) float32 share of its distance by which each point may be nearer, 0 to 1.
        """
        direction = np.arctan2(right_m, forward_m)
        direction *= _PER_RADIAN
        direction += _REAR_OFFSET
        with np.errstate(invalid="ignore"):
            cell = direction.astype(np.int32)
        cell *= np.int32(self._bins)
        octaves = np.maximum(range_m, np.float32(NEAREST_BIN_M)).view(np.int32)
        octaves >>= _MANTISSA_SHIFT
        cell += octaves
        cell -= self._first_bin - 1  # cell 0 takes what is not wanted
        end = self._used + len(cell)
        np.multiply(cell, wanted, out=self._cells[self._used : end])
        if shortening is not None:
            self._doubt[self._used : end] = shortening
            self._doubted = True
        self._used = end

    def nearest_m(
        self, needed: NDArray[np.int64], line_needed: NDArray[np.int64] | None = None
    ) -> NDArray[np.float32]:
        """The nearest distance in each direction that has enough points within `SUPPORT_SPAN` of each other.

        A thing that goes on through `LINE_ELEMENTS` neighbouring elements, such as a wire across the way, is
        found with fewer: near the vehicle an element is narrow, and a wire shows little of itself in each.
        Half of them may be nearer than the distance told for it.

        Args:
            needed: (bins,) points that make an obstacle at each bin's distance.
            line_needed: (72,) points that each element must have of such a line.

        Returns:
            (72,) float32 distance in metres, rounded down to a bin's edge, and shortened by the mean of what
            the supporting points may be nearer; NaN where nothing is found. Doubt shortens a distance only
            once it is found: it neither hides a thing nor splits it.
        """
        nearest = np.full(SECTOR_COUNT, np.nan, dtype=np.float32)
        # One row more than directions: straight behind is reached from both sides.
        size = (SECTOR_COUNT + 1) * self._bins + 1
        counts = np.bincount(self._cells[: self._used], minlength=size)[1:size]
        counts = counts.reshape(SECTOR_COUNT + 1, self._bins)
        counts[0] += counts[-1]
        rows = np.flatnonzero(counts[:-1].sum(axis=1) >= needed.min())

        below = np.zeros((rows.size, self._bins + 1), dtype=np.int64)
        np.cumsum(counts[rows], axis=1, out=below[:, 1:])
        support = below.take(self._window_end, axis=1)
        support -= below[:, :-1]
        doubt = self._summed_doubt(size, rows) if self._doubted else None
        enough = support >= needed
        starts = np.where(enough.any(axis=1), enough.argmax(axis=1), self._bins)
        least = needed[np.minimum(starts, self._bins - 1)]
        if line_needed is not None:
            of_row = line_needed[(rows - _ROWS_TO_FIRST_BEARING) % SECTOR_COUNT]
            line = self._lines(support >= of_row[:, None], rows)
            # The front of a wall is a line too: only what ends before the next thing begins is a line alone.
            nearer = np.append(self._window_end, self._bins + 1)[line] <= starts
            starts, least = np.where(nearer, line, starts), np.where(nearer, of_row // 2, least)
        row = np.flatnonzero(starts < self._bins)
        start = starts[row]
        supported = support[row, start]
        quantile = (NEAR_QUANTILE * supported).astype(np.int64)
        rank = below[row, start] + np.maximum(least[row], quantile)
        # Counts of the bins below never fall from bin to bin, so this is where each row reaches its rank.
        reached = np.count_nonzero(below[row] < rank[:, None], axis=1) - 1
        distance = self.edges_m[reached]
        if doubt is not None:
            mean = (doubt[row, self._window_end[start]] - doubt[row, start]) / supported
            distance = distance * (1.0 - mean).astype(np.float32)
        nearest[(rows[row] - _ROWS_TO_FIRST_BEARING) % SECTOR_COUNT] = distance
        return nearest

    def _lines(self, enough: NDArray[np.bool_], rows: NDArray[np.intp]) -> NDArray[np.intp]:
        """(rows,) nearest bin of a line through each row and its neighbours; the number of bins for none."""
        first = np.full(SECTOR_COUNT, self._bins)
        first[rows] = np.where(enough.any(axis=1), enough.argmax(axis=1), self._bins)
        distance = np.append(self.edges_m[:-1], np.float32(np.nan))[first]
        following = np.roll(distance, -1)
        with np.errstate(invalid="ignore"):
            joined = np.maximum(distance, following) <= LINE_STEP * np.minimum(distance, following)
        along = np.zeros(SECTOR_COUNT, dtype=np.bool_)
        starts = np.logical_and.reduce([np.roll(joined, -step) for step in range(LINE_ELEMENTS - 1)])
        for step in range(LINE_ELEMENTS):
            along |= np.roll(starts, step)
        return np.asarray(np.where(along, first, self._bins)[rows], dtype=np.intp)

    def _summed_doubt(self, size: int, rows: NDArray[np.intp]) -> NDArray[np.float64]:
        """(rows, bins + 1) shortening of all points below each bin."""
        total = np.bincount(self._cells[: self._used], self._doubt[: self._used], size)[1:size]
        total = total.reshape(SECTOR_COUNT + 1, self._bins)
        total[0] += total[-1]
        below = np.zeros((rows.size, self._bins + 1))
        np.cumsum(total[rows], axis=1, out=below[:, 1:])
        return below
