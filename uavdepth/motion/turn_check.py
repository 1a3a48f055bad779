"""The focal length held against the autopilot: by how much the pictures turn when the vehicle turns."""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

_LEAST_TURN_RAD = math.radians(6.0)
"""Half a degree of attitude is 8 % of it."""

_MEMORY = 150.0
"""So many turns (one a picture, overlapping) count; older ones fade."""

_LEAST_TURNS = 15.0
_LEAST_OFF = 0.05
_SIGMAS = 3.0


class TurnCheck:
    """How far the pictures turn, as a share of how far the autopilot says that the camera has turned.

    A turn of a rad moves what stands ahead by the focal length in pixels: believed to be 10 % longer than it
    is, the same pixels are a turn that is 10 % smaller. Flight ahead says nothing of the focal length, and
    in sideways flight points and ground are off by the same factor, so turns are the one sure sign.
    """

    def __init__(self) -> None:
        self.clear()

    def clear(self) -> None:
        """Forget all turns."""
        self._weight = 0.0
        self._mean = 0.0
        self._square = 0.0

    def add(self, told: NDArray[np.float64], seen: NDArray[np.float64]) -> None:
        """A turn between two pictures; small ones are left out.

        Args:
            told: (3, 3) rotation by the autopilot.
            seen: (3, 3) the same by the pictures.
        """
        by_autopilot, by_pictures = cv2.Rodrigues(told)[0].ravel(), cv2.Rodrigues(seen)[0].ravel()
        length = float(by_autopilot @ by_autopilot)
        if length < _LEAST_TURN_RAD**2:
            return
        ratio = float(by_autopilot @ by_pictures) / length
        self._weight = self._weight * (1.0 - 1.0 / _MEMORY) + 1.0
        self._mean += (ratio - self._mean) / self._weight
        self._square += (ratio**2 - self._square) / self._weight

    @property
    def ratio(self) -> float | None:
        """Turn of the pictures over turn of the autopilot; None before enough turns."""
        return self._mean if self._weight >= _LEAST_TURNS else None

    @property
    def suspicion(self) -> str | None:
        """What is wrong with the focal length, in words, or None."""
        ratio = self.ratio
        if ratio is None:
            return None
        spread = math.sqrt(max(self._square - ratio**2, 0.0))
        # Neighbouring turns overlap, so their scatter does not average out well.
        if abs(ratio - 1.0) < max(_LEAST_OFF, _SIGMAS * spread / math.sqrt(_LEAST_TURNS)):
            return None
        percent = 100.0 * (1.0 / max(ratio, 0.1) - 1.0)
        return (
            f"the pictures turn {100 * (ratio - 1):+.0f} % against the autopilot: the focal length in pixels "
            f"is {abs(percent):.0f} % too {'long' if percent > 0 else 'short'}"
        )
