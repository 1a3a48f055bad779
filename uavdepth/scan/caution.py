"""What doubt of a distance means for a scan: where an obstacle may begin, and what frees nothing."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from uavdepth.errors import ScanError

LARGEST_SHORTENING = 0.25
"""However doubtful a distance, at most so much of it is taken off: an obstacle at no distance at all would
stop the vehicle for good. What may so begin within maximum distance is told; what only may by more doubt
than this is unknown."""

FREEING_SIGMAS = 1.0
"""A way is freed by so many standard deviations, or by as many as shorten distances if these are more: what
is nearest in an element has erred towards the vehicle already, what is taken for free has not
(docs/flight-evaluation.md).
"""


class ScanCaution:
    """Distances d with a relative standard deviation sigma: told as d * (1 - factor * sigma), and free only
    where d * (1 - `FREEING_SIGMAS` * sigma) is.

    Args:
        sigma_factor: standard deviations that distances are shortened by, 0 to 5; 0: neither is anything
            shortened, nor is a way freed by less than its distance.
        max_relative_sigma: depth more doubtful than this frees nothing; above 0.

    Raises:
        ScanError: a number outside its limits.
    """

    def __init__(self, sigma_factor: float, max_relative_sigma: float) -> None:
        if not 0.0 <= sigma_factor <= 5.0:
            raise ScanError(f"sigma_factor is {sigma_factor}: 0 to 5 is needed")
        if not max_relative_sigma > 0.0:
            raise ScanError(f"max_relative_sigma is {max_relative_sigma}: above 0 is needed")
        self._factor = np.float32(sigma_factor)
        self._max_sigma = np.float32(max_relative_sigma)
        self._freeing = np.float32(max(FREEING_SIGMAS, sigma_factor) if sigma_factor > 0 else 0.0)
        self._largest = np.float32(LARGEST_SHORTENING if sigma_factor > 0 else 0.0)

    def farthest_m(self, max_distance_m: float) -> float:
        """The longest range that `told` returns."""
        return max_distance_m / (1.0 - float(self._largest))

    def told(
        self, sigma: NDArray[np.float32], max_distance_m: float
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """(N,) share of each pixel's distance to take off, and (N,) range within which it is an obstacle."""
        most_m, tells = np.float32(max_distance_m), self._tells(sigma)
        shortening = np.where(tells, np.minimum(_times(sigma, self._factor), self._largest), self._largest)
        reach = np.minimum(_times(sigma, self._freeing), self._largest)
        return shortening, np.where(tells, most_m / (1 - reach), most_m)

    def least_share(self, sigma: NDArray[np.float32]) -> NDArray[np.float32]:
        """(N,) share of its distance that each pixel lies beyond for certain, above 0; NaN for none."""
        doubt = _times(sigma, self._freeing)
        return np.where(self._tells(sigma) & (doubt < 1), 1 - doubt, np.float32(np.nan))

    def _tells(self, sigma: NDArray[np.float32]) -> NDArray[np.bool_]:
        """Whether depth is worth something; NaN fails: no claim is not a small claim."""
        return np.asarray((sigma >= 0) & (sigma <= self._max_sigma), dtype=np.bool_)


def _times(sigma: NDArray[np.float32], factor: np.float32) -> NDArray[np.float32]:
    """Share of its distance by which depth may be nearer; no number where doubt is none."""
    with np.errstate(over="ignore", invalid="ignore"):
        return sigma * factor
