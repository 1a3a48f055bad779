"""What doubt of a distance means for a scan: where an obstacle may begin, and what frees nothing."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from uavdepth.errors import ScanError

LARGEST_SHORTENING = 0.4
"""However doubtful a distance, at most so much of it is taken off: an obstacle at no distance at all would
stop the vehicle for good. The network that ships is off by no more downwards where it doubts more: where it
claims 0.3 to 0.6, one true distance in six is below 0.8 of the told one, and one in twenty below 0.5."""


class ScanCaution:
    """Distances d with a relative standard deviation sigma, which may be as near as d * (1 - factor * sigma).

    Args:
        sigma_factor: standard deviations that distances are shortened by, 0 to 5; 0: not at all.
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
        self.largest_shortening = LARGEST_SHORTENING if sigma_factor > 0 else 0.0

    def told(
        self, sigma: NDArray[np.float32], max_distance_m: float
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """(N,) share of each pixel's distance to take off, and (N,) range within which it is an obstacle."""
        largest, most_m = np.float32(self.largest_shortening), np.float32(max_distance_m)
        tells = self._tells(sigma)
        shortening = np.where(tells, np.minimum(self._doubt(sigma), largest), largest)
        return shortening, np.where(tells, most_m / (1 - shortening), most_m)

    def least_share(self, sigma: NDArray[np.float32]) -> NDArray[np.float32]:
        """(N,) share of its distance that each pixel lies beyond for certain, above 0; NaN for none."""
        doubt = self._doubt(sigma)
        return np.where(self._tells(sigma) & (doubt < 1), 1 - doubt, np.float32(np.nan))

    def _tells(self, sigma: NDArray[np.float32]) -> NDArray[np.bool_]:
        """Whether depth is worth something; NaN fails: no claim is not a small claim."""
        return np.asarray((sigma >= 0) & (sigma <= self._max_sigma), dtype=np.bool_)

    def _doubt(self, sigma: NDArray[np.float32]) -> NDArray[np.float32]:
        """Share of its distance by which depth may be nearer."""
        with np.errstate(over="ignore", invalid="ignore"):
            return sigma * self._factor
