"""Errors of many frames put together: means for pixels, pooled counts for elements and doubt."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from training.evaluation import FrameErrors, SourceErrors
from training.evaluation_bands import BAND_EDGES_M, mean_of_bands
from training.evaluation_doubt import LAPLACE_COVERAGE, NOMINAL_COVERAGE, SIGMAS, DoubtErrors, pooled
from training.evaluation_obstacles import ElementErrors, all_elements
from training.evaluation_sky import SkyErrors
from training.metrics import DepthMetrics

_DIGITS = 4


@dataclass(frozen=True)
class DoubtSummary:
    """Doubt of one source over many pictures.

    Args:
        coverage: share of pixels within each of `evaluation_doubt.SIGMAS`; each picture counts alike.
        all_abs_rel, surest_abs_rel, rank_correlation: means over pictures of what is said within each.
        pooled: the same over pixels of all pictures together.
    """

    coverage: tuple[float, ...]
    all_abs_rel: float
    surest_abs_rel: float
    rank_correlation: float
    pooled: DoubtErrors

    def as_json(self) -> dict[str, Any]:
        """Plain values."""
        return {
            "reliability": [
                {
                    "sigmas": sigma,
                    "nominal": _round(gauss),
                    "nominal_laplace": _round(laplace),
                    "real": _round(real),
                }
                for sigma, gauss, laplace, real in zip(
                    SIGMAS, NOMINAL_COVERAGE, LAPLACE_COVERAGE, self.coverage, strict=True
                )
            ],
            "within_one_sigma": _round(self.coverage[SIGMAS.index(1.0)]),
            "per_picture": _sharpness(self.all_abs_rel, self.surest_abs_rel, self.rank_correlation),
            "pooled": _sharpness(
                self.pooled.all_abs_rel, self.pooled.surest_abs_rel, self.pooled.rank_correlation
            ),
        }


@dataclass(frozen=True)
class SourceSummary:
    """One source over many frames, each counting alike; None for what no frame has.

    Args:
        label: the source.
        errors: of the frames on which it had an answer.
    """

    label: str
    errors: tuple[SourceErrors, ...]

    @property
    def frames(self) -> int:
        """Frames on which it had an answer."""
        return len(self.errors)

    @property
    def scaled(self) -> DepthMetrics | None:
        """Mean errors at the truth's median."""
        return DepthMetrics.mean([item.scaled.overall for item in self.errors])

    @property
    def metric(self) -> DepthMetrics | None:
        """Mean errors in metres as given."""
        return DepthMetrics.mean([item.metric.overall for item in self.errors if item.metric is not None])

    @property
    def scaled_bands(self) -> list[tuple[DepthMetrics | None, int]]:
        """Mean errors at the truth's median and pictures of each distance band."""
        return mean_of_bands([item.scaled for item in self.errors])

    @property
    def metric_bands(self) -> list[tuple[DepthMetrics | None, int]]:
        """Mean errors as given and pictures of each distance band."""
        return mean_of_bands([item.metric for item in self.errors if item.metric is not None])

    @property
    def doubt(self) -> DoubtSummary | None:
        """How well sigma fits."""
        found = [item.doubt for item in self.errors if item.doubt is not None]
        together = pooled(found)
        if together is None:
            return None
        return DoubtSummary(
            tuple(float(value) for value in np.mean([item.coverage for item in found], axis=0)),
            float(np.mean([item.all_abs_rel for item in found])),
            float(np.mean([item.surest_abs_rel for item in found])),
            float(np.mean([item.rank_correlation for item in found])),
            together,
        )

    @property
    def sky(self) -> SkyErrors | None:
        """What is said of the sky, on the mean of the pictures that show some."""
        found = [item.sky for item in self.errors if item.sky is not None]
        if not found:
            return None
        return SkyErrors(
            float(np.mean([item.far_share for item in found])),
            _mean([item.sigma for item in found]),
            _mean([item.sigma_elsewhere for item in found]),
        )

    @property
    def elements(self) -> ElementErrors | None:
        """Nearest obstacles of all frames."""
        return all_elements([item.elements for item in self.errors if item.elements is not None])

    def as_json(self) -> dict[str, Any]:
        """Everything as plain values."""
        doubt, elements, sky = self.doubt, self.elements, self.sky
        factors = [item.factor for item in self.errors]
        return {
            "frames": self.frames,
            "median_scaled": metrics_json(self.scaled),
            "metric": metrics_json(self.metric),
            "median_factor": _round(float(np.median(factors))) if factors else None,
            "unknown_share": _round(float(np.mean([e.unknown_share for e in self.errors])))
            if factors
            else None,
            "bands": [
                {
                    "from_m": BAND_EDGES_M[band],
                    "to_m": BAND_EDGES_M[band + 1],
                    "pixels": sum(item.scaled.pixels[band] for item in self.errors),
                    "pictures": pictures,
                    "median_scaled": metrics_json(scaled),
                    "metric": metrics_json(metric),
                }
                for band, ((scaled, pictures), (metric, _)) in enumerate(
                    zip(self.scaled_bands, self.metric_bands, strict=True)
                )
            ],
            "sigma": None if doubt is None else doubt.as_json(),
            "sky": None if sky is None else _sky_json(sky),
            "nearest_obstacle": None if elements is None else elements_json(elements),
        }


def summarise(errors: Sequence[FrameErrors], labels: Sequence[str]) -> list[SourceSummary]:
    """Each source over the frames on which it had an answer."""
    return [
        SourceSummary(label, tuple(item.sources[label] for item in errors if label in item.sources))
        for label in labels
    ]


def metrics_json(metrics: DepthMetrics | None) -> dict[str, float] | None:
    """The seven errors, rounded; None as it is."""
    return None if metrics is None else {key: _round(value) for key, value in metrics.as_dict().items()}


def elements_json(elements: ElementErrors) -> dict[str, Any]:
    """Nearest obstacles as plain values."""
    shares = {
        "median_relative_error": elements.median_error,
        "missed_share": elements.missed_share,
        "missed_with_both_neighbours_share": elements.alone_share,
        "unknown_share": elements.unknown_share,
        "false_alarm_share": elements.false_alarm_share,
    }
    return {
        "elements": elements.measured,
        "missed_clear": elements.missed_clear,
        "missed_too_far": elements.missed_far,
        "free_elements": elements.free,
        **{key: None if value is None else _round(value) for key, value in shares.items()},
    }


def _sky_json(sky: SkyErrors) -> dict[str, float | None]:
    return {
        "far_share": _round(sky.far_share),
        "median_sigma": None if sky.sigma is None else _round(sky.sigma),
        "median_sigma_elsewhere": None if sky.sigma_elsewhere is None else _round(sky.sigma_elsewhere),
    }


def _mean(values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return float(np.mean(known)) if known else None


def _sharpness(everything: float, surest: float, correlation: float) -> dict[str, float]:
    return {
        "abs_rel": _round(everything),
        "abs_rel_of_surest_half": _round(surest),
        "surest_half_over_all": _round(surest / everything) if everything > 0 else 1.0,
        "rank_correlation": _round(correlation),
    }


def _round(value: float) -> float:
    return round(value, _DIGITS)
