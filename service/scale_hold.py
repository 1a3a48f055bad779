"""Keeps the metric scale through pictures without ground."""

from __future__ import annotations

from dataclasses import dataclass

from uavdepth.ground_scale import GroundScale


@dataclass(frozen=True)
class ScaleStatus:
    """The metric scale that a picture was measured with.

    Args:
        factor: network units to metres.
        relative_sigma: its relative standard deviation.
        age_s: time since the ground was seen, seconds; 0 if on this picture.
    """

    factor: float
    relative_sigma: float
    age_s: float


class ScaleHold:
    """The newest scale, for as long as it may be used without ground in sight.

    Args:
        hold_ns: how long.
    """

    def __init__(self, hold_ns: int) -> None:
        self._hold_ns = hold_ns
        self._scale: GroundScale | None = None
        self._seen_ns = 0

    def update(self, scale: GroundScale | None, at_ns: int) -> ScaleStatus | None:
        """The scale to use for the picture captured at `at_ns`, given what its ground says."""
        if scale is not None:
            self._scale, self._seen_ns = scale, at_ns
        if self._scale is None or not 0 <= at_ns - self._seen_ns <= self._hold_ns:
            return None
        return ScaleStatus(self._scale.factor, self._scale.relative_sigma, (at_ns - self._seen_ns) / 1e9)
