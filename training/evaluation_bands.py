"""Errors by distance: what matters at 3 m says nothing about 60 m."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from training.metrics import DEPTH_CAP_M, DepthMetrics, PixelErrors

BAND_EDGES_M = (0.0, 2.0, 5.0, 10.0, 20.0, 40.0, DEPTH_CAP_M)
"""A pixel belongs to the band of its true depth: from one edge up to, but without, the next."""


@dataclass(frozen=True)
class BandedErrors:
    """Errors of one picture at one scale.

    Args:
        overall: of all pixels that count.
        bands: of each band, nearest first; None where the picture shows too little of it.
        pixels: that count in each band.
    """

    overall: DepthMetrics
    bands: tuple[DepthMetrics | None, ...]
    pixels: tuple[int, ...]


def banded_errors(
    truth_m: NDArray[np.float32], predicted_m: NDArray[np.float32], factor: float = 1.0
) -> BandedErrors | None:
    """Errors of one picture; arguments as in `training.metrics.depth_metrics`, None as there."""
    pixels = PixelErrors.of(truth_m, predicted_m, factor)
    overall = pixels.mean()
    if overall is None:
        return None
    band = np.digitize(pixels.truth_m, BAND_EDGES_M[1:-1])
    chosen = [band == number for number in range(len(BAND_EDGES_M) - 1)]
    return BandedErrors(
        overall,
        tuple(pixels.where(part).mean() for part in chosen),
        tuple(int(np.count_nonzero(part)) for part in chosen),
    )


def mean_of_bands(errors: Sequence[BandedErrors]) -> list[tuple[DepthMetrics | None, int]]:
    """Mean errors of each band and the number of pictures that show enough of it."""
    means = []
    for band in range(len(BAND_EDGES_M) - 1):
        shown = [found for item in errors if (found := item.bands[band]) is not None]
        means.append((DepthMetrics.mean(shown), len(shown)))
    return means


def band_names() -> list[str]:
    """Each band as text: "0-2 m"."""
    return [f"{low:g}-{high:g} m" for low, high in itertools.pairwise(BAND_EDGES_M)]
