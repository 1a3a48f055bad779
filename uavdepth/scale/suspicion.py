"""Two sources of metres that keep contradicting each other: something that was configured is wrong."""

from __future__ import annotations

import math

_MEMORY_S = 8.0
_LEAST_S = 5.0
"""Both sources must have spoken for so long; a slope or a roof is left behind sooner."""

_LEAST_LOG = math.log(1.12)
_SIGMAS = 2.0


class Disagreement:
    """How far the scale from the ground lies off the one from the vehicle's motion, over some seconds."""

    def __init__(self) -> None:
        self.clear()

    def clear(self) -> None:
        """Forget everything."""
        self._mean = 0.0
        self._square = 0.0
        self._seen_s = 0.0

    def add(self, ground_log: float, points_log: float, passed_s: float) -> None:
        """Both logs of factors of one picture."""
        off = ground_log - points_log
        share = 1.0 if self._seen_s == 0.0 else 1.0 - math.exp(-passed_s / min(_MEMORY_S, self._seen_s + 0.5))
        self._mean += share * (off - self._mean)
        self._square += share * (off**2 - self._square)
        self._seen_s = min(self._seen_s + max(passed_s, 1e-6), 10 * _MEMORY_S)

    def rest(self, passed_s: float) -> None:
        """Time in which not both sources spoke: what was found fades."""
        self._seen_s *= math.exp(-passed_s / (4 * _MEMORY_S))

    @property
    def text(self) -> str | None:
        """What is suspected, or None."""
        spread = math.sqrt(max(self._square - self._mean**2, 0.0))
        if self._seen_s < _LEAST_S or abs(self._mean) < max(_LEAST_LOG, _SIGMAS * spread):
            return None
        percent = 100 * (math.exp(self._mean) - 1)
        return (
            f"metres from the ground are {percent:+.0f} % off those from motion for {self._seen_s:.0f} s: "
            "focal length, mount pitch or height is wrong, or the ground is not level"
        )
