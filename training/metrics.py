"""The seven errors of the field: Eigen et al. 2014, as KITTI's tables have them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields

import numpy as np
from numpy.typing import NDArray

DEPTH_CAP_M = 80.0
"""Truth from here on, sky included, is not measured; predictions are cut off here."""

SMALLEST_DEPTH_M = 0.1
"""Truth nearer than this is not measured, predictions are cut off here: no network says less."""

MIN_PIXELS = 100
"""Fewer pixels with a truth say nothing about a picture."""


@dataclass(frozen=True)
class DepthMetrics:
    """Errors of one picture, or their mean over pictures. d is the truth, p the prediction, in metres.

    Args:
        abs_rel: mean of |d - p| / d.
        sq_rel: mean of (d - p)^2 / d, metres.
        rmse: root of the mean of (d - p)^2, metres.
        rmse_log: root of the mean of (log d - log p)^2.
        below_125, below_125_2, below_125_3: share of pixels with max(d/p, p/d) below 1.25, 1.25^2, 1.25^3.
    """

    abs_rel: float
    sq_rel: float
    rmse: float
    rmse_log: float
    below_125: float
    below_125_2: float
    below_125_3: float

    @classmethod
    def mean(cls, metrics: Sequence[DepthMetrics]) -> DepthMetrics | None:
        """Mean over pictures, each counting alike; None for no pictures."""
        if not metrics:
            return None
        values = {
            field.name: math.fsum(getattr(item, field.name) for item in metrics) / len(metrics)
            for field in fields(cls)
        }
        return cls(**values)

    def as_dict(self) -> dict[str, float]:
        """Plain numbers by name."""
        return asdict(self)


def measurable(truth_m: NDArray[np.float32], predicted_m: NDArray[np.float32]) -> NDArray[np.bool_]:
    """(H, W) pixels that count: truth known, from the smallest depth to the cap, and prediction known."""
    with np.errstate(invalid="ignore"):
        counted = (truth_m >= SMALLEST_DEPTH_M) & (truth_m < DEPTH_CAP_M)
    return np.asarray(counted & ~np.isnan(predicted_m), np.bool_)


def median_factor(truth_m: NDArray[np.float32], predicted_m: NDArray[np.float32]) -> float | None:
    """Median of the truth over median of the prediction, over the pixels that count.

    The usual factor for networks without a scale; it needs the truth, so no vehicle has it.

    Returns:
        The factor, or None with fewer than `MIN_PIXELS`, or for a median prediction of 0 or infinity.
    """
    valid = measurable(truth_m, predicted_m)
    if np.count_nonzero(valid) < MIN_PIXELS:
        return None
    middle = float(np.median(predicted_m[valid]))
    if not (math.isfinite(middle) and middle > 0):
        return None
    return float(np.median(truth_m[valid])) / middle


def depth_metrics(
    truth_m: NDArray[np.float32], predicted_m: NDArray[np.float32], factor: float = 1.0
) -> DepthMetrics | None:
    """Errors of one picture.

    Args:
        truth_m: (H, W) float32 z-depth in metres, +inf in the sky, NaN or 0 where not known.
        predicted_m: (H, W) float32 predicted z-depth in metres, NaN where unknown (left out), +inf allowed.
        factor: that the prediction is multiplied by first.

    Returns:
        The errors, or None with fewer than `MIN_PIXELS` pixels that count.
    """
    return PixelErrors.of(truth_m, predicted_m, factor).mean()


@dataclass(frozen=True)
class PixelErrors:
    """Errors of the pixels of one picture that count, each (N,) float64.

    Args:
        truth_m: z-depth in metres.
        error_m: truth less prediction, metres, after the prediction was cut off at both ends.
        log_error: size of the log of prediction over truth.
    """

    truth_m: NDArray[np.float64]
    error_m: NDArray[np.float64]
    log_error: NDArray[np.float64]

    @classmethod
    def of(
        cls, truth_m: NDArray[np.float32], predicted_m: NDArray[np.float32], factor: float = 1.0
    ) -> PixelErrors:
        """Errors of a picture; arguments as in `depth_metrics`."""
        valid = measurable(truth_m, predicted_m)
        truth = truth_m[valid].astype(np.float64)
        predicted = np.clip(predicted_m[valid].astype(np.float64) * factor, SMALLEST_DEPTH_M, DEPTH_CAP_M)
        return cls(truth, truth - predicted, np.abs(np.log(truth / predicted)))

    def where(self, chosen: NDArray[np.bool_]) -> PixelErrors:
        """Only some of the pixels."""
        return PixelErrors(self.truth_m[chosen], self.error_m[chosen], self.log_error[chosen])

    def mean(self) -> DepthMetrics | None:
        """The seven errors, or None with fewer than `MIN_PIXELS` pixels."""
        if self.truth_m.size < MIN_PIXELS:
            return None
        squared = np.square(self.error_m)
        below = [float(np.mean(self.log_error < power * math.log(1.25))) for power in (1, 2, 3)]
        return DepthMetrics(
            abs_rel=float(np.mean(np.abs(self.error_m) / self.truth_m)),
            sq_rel=float(np.mean(squared / self.truth_m)),
            rmse=float(np.sqrt(np.mean(squared))),
            rmse_log=float(np.sqrt(np.mean(np.square(self.log_error)))),
            below_125=below[0],
            below_125_2=below[1],
            below_125_3=below[2],
        )
