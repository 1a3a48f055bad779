"""Holding the scale through pictures that do not show it."""

from __future__ import annotations

import math

from uavdepth.ground_scale import GroundScale

SMOOTHING_S = 0.3
"""Time constant on steady estimates: single pictures scatter by some percent, ground moves slowly."""

DRIFT_PER_SQRT_S = 0.06
"""A network's scale wanders with what it sees: relative sigma added by the square root of a second."""


class ScaleTracker:
    """Smooths scale estimates and holds the last one for a while: near a wall the ground leaves the view.

    Times are passed in. After `max_age_s` without an estimate the scale is None, and depth unknown.

    Args:
        max_age_s: how long a scale is held without a new estimate, seconds.
    """

    def __init__(self, max_age_s: float = 2.0) -> None:
        if not (math.isfinite(max_age_s) and max_age_s >= 0):
            raise ValueError(f"max_age_s is {max_age_s}: a finite time of 0 s or more is needed")
        self.max_age_s = max_age_s
        self._scale: GroundScale | None = None
        self._at_ns = 0

    def update(self, estimate: GroundScale | None, now_ns: int) -> GroundScale | None:
        """The scale to use now.

        Args:
            estimate: of the newest picture, None where it shows none.
            now_ns: when that picture was taken. A step back in time starts anew.

        Returns:
            The smoothed scale, its sigma growing with the age of the last estimate, or None.
        """
        age_s = (now_ns - self._at_ns) * 1e-9
        if age_s < 0 or age_s > self.max_age_s:
            self._scale = None
        if estimate is None:
            return None if self._scale is None else _aged(self._scale, age_s)
        self._scale = estimate if self._scale is None else _merged(_aged(self._scale, age_s), estimate, age_s)
        self._at_ns = now_ns
        return self._scale


def _aged(scale: GroundScale, age_s: float) -> GroundScale:
    sigma = math.hypot(scale.relative_sigma, DRIFT_PER_SQRT_S * math.sqrt(age_s))
    return GroundScale(scale.factor, sigma, scale.pixels)


def _merged(held: GroundScale, estimate: GroundScale, age_s: float) -> GroundScale:
    """Exponential smoothing of log factors; what the two disagree on is uncertainty too."""
    weight = 1.0 - math.exp(-age_s / SMOOTHING_S)
    step = math.log(estimate.factor / held.factor)
    sigma = (1.0 - weight) * held.relative_sigma + weight * estimate.relative_sigma
    return GroundScale(
        held.factor * math.exp(weight * step),
        math.hypot(sigma, math.sqrt(weight * (1.0 - weight)) * step),
        estimate.pixels,
    )
