"""Sky has no distance: a network must not see anything near there, and should say that it is unsure."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from training.metrics import MIN_PIXELS

FAR_M = 40.0
"""Sky nearer than this would be an obstacle in the air."""


@dataclass(frozen=True)
class SkyErrors:
    """What a source says about the sky of one picture.

    Args:
        far_share: of the sky's pixels, said to be at `FAR_M` or beyond, or unknown.
        sigma: median of sigma in the sky, None without sigma.
        sigma_elsewhere: median of sigma on everything else.
    """

    far_share: float
    sigma: float | None
    sigma_elsewhere: float | None


def sky_errors(
    truth_m: NDArray[np.float32],
    predicted_m: NDArray[np.float32],
    relative_sigma: NDArray[np.float32] | None,
) -> SkyErrors | None:
    """What is said about pixels whose truth is +inf; None with fewer than `MIN_PIXELS` of them."""
    sky = np.isposinf(truth_m)
    if np.count_nonzero(sky) < MIN_PIXELS:
        return None
    with np.errstate(invalid="ignore"):
        far = ~(predicted_m[sky] < FAR_M)
    if relative_sigma is None:
        return SkyErrors(float(far.mean()), None, None)
    return SkyErrors(
        float(far.mean()), _median(relative_sigma[sky]), _median(relative_sigma[np.isfinite(truth_m)])
    )


def _median(values: NDArray[np.float32]) -> float | None:
    known = values[np.isfinite(values)]
    return float(np.median(known)) if known.size else None
