"""Whether a network knows its doubt: is its sigma as large as its errors, and is it large where they are?"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from training.metrics import MIN_PIXELS, measurable

SIGMAS = (0.5, 1.0, 1.5, 2.0)

NOMINAL_COVERAGE = tuple(math.erf(sigma / math.sqrt(2.0)) for sigma in SIGMAS)
"""Share of pixels within so many sigma if errors were Gaussian: 38, 68, 87 and 95 %."""

LAPLACE_COVERAGE = tuple(1.0 - math.exp(-math.sqrt(2.0) * sigma) for sigma in SIGMAS)
"""The same for errors of a Laplace distribution with that standard deviation: 51, 76, 88 and 94 %."""

_SAMPLE = 500
"""Pixels that each picture gives to what is pooled over pictures; each picture counts alike."""

_RANKED = 5000
"""Pixels of a picture that are ranked."""


@dataclass(frozen=True)
class DoubtErrors:
    """How well the sigma of one picture, or of many, fits the errors.

    Args:
        coverage: share of pixels whose error is below each of `SIGMAS` times sigma.
        all_abs_rel: mean of |d - p| / d.
        surest_abs_rel: the same over the half of the pixels with the smallest sigma.
        rank_correlation: Spearman's, of sigma and error: 1 when sigma grows with the error.
        sample_error: (n,) float32 |d - p| / d of a sample of the pixels.
        sample_ratio: (n,) float32 log error over sigma of the same.
        sample_sigma: (n,) float32 relative sigma of the same.
    """

    coverage: tuple[float, ...]
    all_abs_rel: float
    surest_abs_rel: float
    rank_correlation: float
    sample_error: NDArray[np.float32]
    sample_ratio: NDArray[np.float32]
    sample_sigma: NDArray[np.float32]

    @property
    def within_one_sigma(self) -> float:
        """Share of pixels within one sigma."""
        return self.coverage[SIGMAS.index(1.0)]


def doubt_errors(
    truth_m: NDArray[np.float32], predicted_m: NDArray[np.float32], relative_sigma: NDArray[np.float32]
) -> DoubtErrors | None:
    """Compare sigma with the metric error, as given, pixel by pixel.

    The error that sigma is held against is |log(prediction / truth)|: sigma is relative, and a factor of
    two too near is as wrong as a factor of two too far.

    Args:
        truth_m: (H, W) float32 z-depth in metres; scored as in `training.metrics`.
        predicted_m: (H, W) float32 predicted z-depth in metres.
        relative_sigma: (H, W) float32 one standard deviation of depth over depth; NaN where unknown.

    Returns:
        None with fewer than `MIN_PIXELS` pixels.
    """
    valid = measurable(truth_m, predicted_m) & np.isfinite(predicted_m) & (relative_sigma > 0)
    valid &= np.isfinite(relative_sigma)
    if np.count_nonzero(valid) < MIN_PIXELS:
        return None
    truth, predicted = truth_m[valid].astype(np.float64), predicted_m[valid].astype(np.float64)
    sigma = relative_sigma[valid].astype(np.float64)
    error = np.abs(truth - predicted) / truth
    ratio = np.abs(np.log(predicted / truth)) / sigma
    return _compare(error, ratio, sigma)


def pooled(pictures: Sequence[DoubtErrors]) -> DoubtErrors | None:
    """The same over the samples of many pictures together, None for none.

    A sigma may be right within each picture and still not tell a hard picture from an easy one.
    """
    if not pictures:
        return None
    error, ratio, sigma = (
        np.concatenate([getattr(item, name) for item in pictures]).astype(np.float64)
        for name in ("sample_error", "sample_ratio", "sample_sigma")
    )
    return _compare(error, ratio, sigma)


def spearman(first: NDArray[np.float64], second: NDArray[np.float64]) -> float:
    """Rank correlation, equal values sharing their mean rank; 0 where one of both never changes."""
    ranks = [_ranks(values) for values in (first, second)]
    spreads = [float(np.std(values)) for values in ranks]
    if min(spreads) == 0.0:
        return 0.0
    product = float(np.mean((ranks[0] - ranks[0].mean()) * (ranks[1] - ranks[1].mean())))
    return product / (spreads[0] * spreads[1])


def _compare(
    error: NDArray[np.float64], ratio: NDArray[np.float64], sigma: NDArray[np.float64]
) -> DoubtErrors:
    surest = np.argsort(sigma, kind="stable")[: max(1, sigma.size // 2)]
    ranked, kept = _every(sigma.size, _RANKED), _every(sigma.size, _SAMPLE)
    return DoubtErrors(
        coverage=tuple(float(np.mean(ratio < limit)) for limit in SIGMAS),
        all_abs_rel=float(error.mean()),
        surest_abs_rel=float(error[surest].mean()),
        rank_correlation=spearman(sigma[ranked], error[ranked]),
        sample_error=error[kept].astype(np.float32),
        sample_ratio=ratio[kept].astype(np.float32),
        sample_sigma=sigma[kept].astype(np.float32),
    )


def _every(size: int, wanted: int) -> NDArray[np.intp]:
    """At most `wanted` numbers below `size`, at equal distances: the same ones every time."""
    return np.unique(np.linspace(0, size - 1, min(size, wanted)).round().astype(np.intp))


def _ranks(values: NDArray[np.float64]) -> NDArray[np.float64]:
    _, place, counts = np.unique(values, return_inverse=True, return_counts=True)
    last = np.cumsum(counts)
    return np.asarray((last - (counts - 1) / 2.0)[place], np.float64)
