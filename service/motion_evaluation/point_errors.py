"""Errors of measured points against exact depth."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from uavdepth.model.hints import PointHints

NEAREST_M, FARTHEST_M = 5.0, 30.0

_REACH_ROWS, _REACH_COLUMNS = 2, 1
_ONE_SURFACE = 1.1
"""Sparse truth is used where its farthest over its nearest number around a point stays below this."""


@dataclass(frozen=True)
class PointSummary:
    """Points between `NEAREST_M` and `FARTHEST_M` of true depth.

    Args:
        count: points of all pictures.
        per_picture: median number of points of a picture, at any depth.
        median, p95: of the relative error of depth.
        bias: median of the signed relative error.
        within_sigma: share of errors below the point's own sigma; 0.68 if it is honest.
        within_two_sigma: the same of twice that; 0.95.
    """

    count: int
    per_picture: float
    median: float
    p95: float
    bias: float
    within_sigma: float
    within_two_sigma: float


@dataclass
class PointErrors:
    """Collects them picture by picture."""

    _errors: list[NDArray[np.float64]] = field(default_factory=list)
    _sigmas: list[NDArray[np.float64]] = field(default_factory=list)
    _counts: list[int] = field(default_factory=list)

    def add(self, points: PointHints, truth_m: NDArray[np.float32]) -> None:
        """Points of one picture."""
        self._counts.append(len(points))
        truth = _truth_at(points, truth_m)
        meant = (truth >= NEAREST_M) & (truth <= FARTHEST_M)
        self._errors.append((points.depth_m / truth - 1.0)[meant].astype(np.float64))
        self._sigmas.append(points.relative_sigma[meant].astype(np.float64))

    def join(self, other: PointErrors) -> None:
        """Add all of another's."""
        self._errors += other._errors
        self._sigmas += other._sigmas
        self._counts += other._counts

    def summary(self) -> PointSummary | None:
        """None where no point was measured at those depths."""
        errors = np.concatenate([np.empty(0), *self._errors])
        if not errors.size:
            return None
        sigmas = np.concatenate(self._sigmas)
        size = np.abs(errors)
        return PointSummary(
            int(errors.size),
            float(np.median(self._counts)),
            float(np.median(size)),
            float(np.quantile(size, 0.95)),
            float(np.median(errors)),
            float(np.mean(size < sigmas)),
            float(np.mean(size < 2 * sigmas)),
        )


def _truth_at(points: PointHints, truth_m: NDArray[np.float32]) -> NDArray[np.float64]:
    """(N,) true depth at each point: its pixel's, or that of LiDAR around it on one surface; else NaN."""
    found = np.full(len(points), np.nan)
    height, width = truth_m.shape
    for number, (column, row) in enumerate(np.rint(points.pixels).astype(int).tolist()):
        if not (0 <= row < height and 0 <= column < width):
            continue
        exact = truth_m[row, column]
        if np.isfinite(exact):
            found[number] = exact
            continue
        around = truth_m[
            max(row - _REACH_ROWS, 0) : row + _REACH_ROWS + 1,
            max(column - _REACH_COLUMNS, 0) : column + _REACH_COLUMNS + 1,
        ]
        around = around[np.isfinite(around)]
        if around.size and around.max() < _ONE_SURFACE * around.min():
            found[number] = float(np.median(around))
    return found
