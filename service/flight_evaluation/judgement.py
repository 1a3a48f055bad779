"""A scan held against the truth, element by element."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from service.flight_evaluation.truth import TrueElements
from uavdepth.scan.obstacle_scan import ObstacleScan, SectorState

MEASURED_M = (2.0, 20.0)
"""Elements whose nearest true obstacle lies in this span are measured."""

TOO_FAR = 1.5
"""An obstacle that is said to be more than this many times as far counts as missed, and one that is said to
be more than this many times nearer than anything that stands there as false."""


@dataclass(frozen=True)
class Tally:
    """Elements of one scan, or of many.

    Args:
        looked_at: elements inside the picture.
        measured: of those, with a true obstacle in `MEASURED_M`.
        missed: of the measured ones, said to be clear or more than `TOO_FAR` times as far.
        unknown: of the measured ones, said to be unknown.
        false: of those looked at, with an obstacle where nothing stands.
        blank: of those looked at, said to be unknown.
        relative_errors: (n,) |told - true| / true of the measured elements with an obstacle.
        nearest_errors: (m,) the same of the nearest obstacle of each scan, true and told; +inf where one is
            true and none told.
    """

    looked_at: int = 0
    measured: int = 0
    missed: int = 0
    unknown: int = 0
    false: int = 0
    blank: int = 0
    relative_errors: NDArray[np.float64] = field(default_factory=lambda: np.empty(0))
    nearest_errors: NDArray[np.float64] = field(default_factory=lambda: np.empty(0))

    @property
    def missed_rate(self) -> float | None:
        """Missed over measured; None where nothing was measured."""
        return self.missed / self.measured if self.measured else None

    @property
    def false_rate(self) -> float | None:
        """False over looked at."""
        return self.false / self.looked_at if self.looked_at else None

    @property
    def unknown_rate(self) -> float | None:
        """Unknown over measured."""
        return self.unknown / self.measured if self.measured else None

    @property
    def nearest_error_median(self) -> float | None:
        """Median relative error of the nearest obstacle."""
        return float(np.median(self.nearest_errors)) if self.nearest_errors.size else None

    @property
    def element_error_median(self) -> float | None:
        """Median relative error of the measured elements."""
        return float(np.median(self.relative_errors)) if self.relative_errors.size else None


def judge(truth: TrueElements, scan: ObstacleScan) -> Tally:
    """What the scan has right and wrong."""
    told = scan.state == SectorState.OBSTACLE
    distance = np.where(told, scan.distance_m.astype(np.float64), np.inf)
    certain = truth.certain_m
    with np.errstate(invalid="ignore"):
        measured = truth.looked_at & (certain >= MEASURED_M[0]) & (certain <= MEASURED_M[1])
        late = told & (distance > TOO_FAR * certain)
        false = truth.looked_at & told & (TOO_FAR * distance < truth.any_m)
    missed = measured & ((scan.state == SectorState.CLEAR) | late)
    unknown = scan.state == SectorState.UNKNOWN
    found = measured & told
    return Tally(
        looked_at=_count(truth.looked_at),
        measured=_count(measured),
        missed=_count(missed),
        unknown=_count(measured & unknown),
        false=_count(false),
        blank=_count(truth.looked_at & unknown),
        relative_errors=np.abs(distance[found] - certain[found]) / certain[found],
        nearest_errors=_nearest_error(
            certain[measured], distance[truth.looked_at], truth.any_m[truth.looked_at]
        ),
    )


def together(tallies: Iterable[Tally]) -> Tally:
    """The elements of many scans."""
    parts = list(tallies)
    counts = {
        name: sum(getattr(part, name) for part in parts)
        for name in ("looked_at", "measured", "missed", "unknown", "false", "blank")
    }
    return Tally(
        **counts,
        relative_errors=np.concatenate([np.empty(0), *(part.relative_errors for part in parts)]),
        nearest_errors=np.concatenate([np.empty(0), *(part.nearest_errors for part in parts)]),
    )


def _nearest_error(
    true_m: NDArray[np.float64], told_m: NDArray[np.float64], any_m: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(0,) or (1,): of the nearest obstacle; a nearer thing that need not be told, such as a wire, may be."""
    if not true_m.size or not told_m.size:
        return np.empty(0)
    nearest = int(told_m.argmin())
    told, true = float(told_m[nearest]), float(true_m.min())
    candidates = [true] if told >= true else [true, float(any_m[nearest])]
    return np.array([min(abs(told - candidate) / candidate for candidate in candidates)])


def _count(chosen: NDArray[np.bool_]) -> int:
    return int(np.count_nonzero(chosen))
