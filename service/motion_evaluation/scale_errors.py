"""Errors of the scale estimator along a journey."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from uavdepth.scale.estimator import ScaleEstimate

MOVING_MPS = 1.0
SETTLED_S = 3.0
"""From so many seconds of motion on the scale has to be right."""

SHORT_DRIVE_S = 0.5
"""The same for drives that are hardly longer than that."""

LARGEST_SIGMA = 0.25
LARGEST_AGE_S = 2.0
"""The gate of the service: beyond either everything is unknown."""

CONVERGED = 0.15


@dataclass(frozen=True)
class ScaleSummary:
    """The scale along one or several journeys, of the pictures whose estimate passes the gate.

    Args:
        pictures: with so much motion behind them that the scale has to be right.
        trusted: share of them that pass the gate.
        median, p95: of the relative error of the scale of those.
        bias: median signed error.
        within_two_sigma: share of errors below twice the estimate's own sigma.
        converged_s: seconds of motion until the error was below 15 % for good, the slowest of all journeys;
            None where one never was.
        early_p95: 95th percentile of the error of pictures before that much motion that pass the gate.
        abs_rel: mean of depth's Abs Rel over the trusted pictures, unscaled.
    """

    pictures: int
    trusted: float
    median: float
    p95: float
    bias: float
    within_two_sigma: float
    converged_s: float | None
    early_p95: float
    abs_rel: float


@dataclass(frozen=True)
class _Row:
    moved_s: float
    error: float
    sigma: float
    trusted: bool
    abs_rel: float


@dataclass
class ScaleErrors:
    """Collects them picture by picture; one journey at a time, `join` puts several together.

    Args:
        settled_s: motion after which the scale has to be right, seconds.
    """

    settled_s: float = SETTLED_S
    _rows: list[_Row] = field(default_factory=list)
    _moved_s: float = 0.0
    _converged: list[float | None] = field(default_factory=list)

    def add(
        self,
        estimate: ScaleEstimate | None,
        log_error: float,
        abs_rel: float,
        speed_mps: float,
        passed_s: float,
    ) -> None:
        """One picture: the estimate, the log of its metres over the true ones, and how the vehicle moved."""
        if speed_mps > MOVING_MPS:
            self._moved_s += passed_s
        if estimate is None or not math.isfinite(log_error):
            self._rows.append(_Row(self._moved_s, math.nan, math.nan, False, math.nan))
            return
        trusted = estimate.relative_sigma <= LARGEST_SIGMA and estimate.age_s <= LARGEST_AGE_S
        error = math.expm1(log_error)
        self._rows.append(_Row(self._moved_s, error, estimate.relative_sigma, trusted, abs_rel))

    def close(self) -> None:
        """The journey is over."""
        moved_s: float | None = None
        for row in reversed(self._rows):
            if not (row.trusted and abs(row.error) <= CONVERGED):
                break
            moved_s = row.moved_s
        # A last picture with a wrong scale is one of the 5 % at most, not a scale that never converged.
        if moved_s is None or moved_s > self.settled_s:
            moved_s = self._first_lasting()
        self._converged.append(moved_s)

    def _first_lasting(self) -> float | None:
        """Motion until the first picture after which 95 % are within `CONVERGED`."""
        good = np.array([row.trusted and abs(row.error) <= CONVERGED for row in self._rows])
        for number in range(len(good)):
            if good[number] and good[number:].mean() >= 0.95:
                return self._rows[number].moved_s
        return None

    def join(self, other: ScaleErrors) -> None:
        """Add all of another's, which is closed."""
        self._rows += other._rows
        self._converged += other._converged

    def summary(self) -> ScaleSummary | None:
        """None where the vehicle never moved long enough."""
        late = [row for row in self._rows if row.moved_s >= self.settled_s]
        early = [abs(row.error) for row in self._rows if row.moved_s < self.settled_s and row.trusted]
        trusted = [row for row in late if row.trusted]
        if not late:
            return None
        errors = np.array([row.error for row in trusted])
        sigmas = np.array([row.sigma for row in trusted])
        nothing = errors.size == 0
        slowest = None
        if self._converged and all(each is not None for each in self._converged):
            slowest = max(each for each in self._converged if each is not None)
        return ScaleSummary(
            len(late),
            len(trusted) / len(late),
            math.nan if nothing else float(np.median(np.abs(errors))),
            math.nan if nothing else float(np.quantile(np.abs(errors), 0.95)),
            math.nan if nothing else float(np.median(errors)),
            math.nan if nothing else float(np.mean(np.abs(errors) < 2 * sigmas)),
            slowest,
            float(np.quantile(early, 0.95)) if early else math.nan,
            math.nan if nothing else float(np.nanmean([row.abs_rel for row in trusted])),
        )
