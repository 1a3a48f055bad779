"""A network's scale over time, told by two sources of which each errs for a while in one direction."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

POINTS, GROUND = "points", "ground"
SOURCES = (POINTS, GROUND)

_LASTING_S = {POINTS: 8.0, GROUND: 8.0}
"""How long the error of a source keeps its sign: velocity errors by seconds, slopes and roofs by the time
that a vehicle needs to leave them behind."""

_GATE = 4.0
"""Standard deviations of what a source says from what was expected, beyond which it is not listened to."""

_PATIENCE_S = 0.7
"""A better source that is beyond the gate for so long is right after all, and what was held is wrong."""

_UNKNOWN = 4.0
"""Variance of a log scale of which nothing is known."""

_FRESH_S = 2.0
_WANDER_MEMORY_S = 0.7
_READING_NOISE = 0.01
"""Of the points' readings from picture to picture, where neither motion nor network changes."""

_LARGEST_WANDER = 0.5


@dataclass(frozen=True)
class ScaleReading:
    """What one source says of one picture.

    Args:
        source: "points" or "ground".
        log_factor: log of metres for each unit of depth.
        lasting_sigma: of its error that stays the same from picture to picture.
        own_sigma: of its error that is another in each picture.
    """

    source: str
    log_factor: float
    lasting_sigma: float
    own_sigma: float


class ScaleFilter:
    """Kalman filter of the log scale and of one lasting error for each source.

    The lasting errors are Ornstein-Uhlenbeck processes (Bar-Shalom, Li and Kirubarajan, "Estimation with
    Applications to Tracking and Navigation", section 8.2, colored noise): a hundred readings in a row with
    the same wrong velocity do not make the scale surer than one, and what one source was found to be off
    against the other is remembered while only one of them speaks.

    Args:
        wander_per_sqrt_s: how fast the network's own scale wanders at least, relative, by the square root of
            a second; where the points' readings wander faster it does too.
    """

    def __init__(self, wander_per_sqrt_s: float) -> None:
        self._wander = wander_per_sqrt_s
        self.clear()

    def clear(self) -> None:
        """Forget everything."""
        self._state = np.zeros(3)
        self._covariance = np.diag([_UNKNOWN, 0.0, 0.0])
        self._lasting = dict.fromkeys(SOURCES, 0.0)
        self._beyond_s = dict.fromkeys(SOURCES, 0.0)
        self._accepted_s = dict.fromkeys(SOURCES, math.inf)
        self._last_points: float | None = None
        self._wander_variance = self._wander**2

    @property
    def known(self) -> bool:
        """Whether any reading was taken since the start."""
        return any(math.isfinite(age_s) for age_s in self._accepted_s.values())

    @property
    def log_factor(self) -> float:
        """Log of metres for each unit of depth."""
        return float(self._state[0])

    @property
    def sigma(self) -> float:
        """One standard deviation of it."""
        return math.sqrt(max(float(self._covariance[0, 0]), 0.0))

    def age_s(self, source: str | None = None) -> float:
        """Seconds since a source, or any, was listened to."""
        return min(self._accepted_s.values()) if source is None else self._accepted_s[source]

    def shift(self, log_factor: float) -> None:
        """The unit of depth has changed by this log factor."""
        self._state[0] += log_factor
        if self._last_points is not None:
            self._last_points += log_factor

    def predict(self, passed_s: float) -> None:
        """Let time pass."""
        for number, source in enumerate(SOURCES, start=1):
            keep = math.exp(-passed_s / _LASTING_S[source])
            self._state[number] *= keep
            self._covariance[number] *= keep
            self._covariance[:, number] *= keep
            self._covariance[number, number] += (1 - keep**2) * self._lasting[source] ** 2
            self._accepted_s[source] += passed_s
        self._covariance[0, 0] += self._wander_variance * passed_s

    def take(self, readings: list[ScaleReading], passed_s: float) -> tuple[str, ...]:
        """Listen to what the sources say of one picture, the points first.

        Args:
            readings: at most one a source.
            passed_s: time since the picture before.

        Returns:
            The sources that were listened to.
        """
        taken = []
        self._watch_wander(readings, passed_s)
        for source in SOURCES:
            reading = next((each for each in readings if each.source == source), None)
            if reading is not None and self._listen(reading, passed_s):
                taken.append(source)
        return tuple(taken)

    def _listen(self, reading: ScaleReading, passed_s: float) -> bool:
        source, number = reading.source, SOURCES.index(reading.source) + 1
        before, self._lasting[source] = self._lasting[source], reading.lasting_sigma
        if source == POINTS and before > 0:
            # The same wrong velocity is a larger share of a slower flight.
            grown = reading.lasting_sigma / before
            self._state[number] *= grown
            self._covariance[number] *= grown
            self._covariance[:, number] *= grown
        if not math.isfinite(self._accepted_s[source]) or self._accepted_s[source] > 5 * _LASTING_S[source]:
            self._state[number] = 0.0
            self._covariance[number] = self._covariance[:, number] = 0.0
            self._covariance[number, number] = reading.lasting_sigma**2
        row = np.zeros(3)
        row[[0, number]] = 1.0
        gain = self._covariance @ row
        variance = float(row @ gain) + reading.own_sigma**2
        surprise = reading.log_factor - float(row @ self._state)
        if abs(surprise) > _GATE * math.sqrt(variance):
            self._beyond_s[source] += passed_s
            if not self._gives_way(source):
                return False
            self._begin_anew(reading, number, surprise)
        else:
            self._state += gain * (surprise / variance)
            self._covariance -= np.outer(gain, gain) / variance
            self._covariance = 0.5 * (self._covariance + self._covariance.T)
        self._beyond_s[source] = 0.0
        self._accepted_s[source] = 0.0
        return True

    def _gives_way(self, source: str) -> bool:
        """Whether what was held is dropped for what this source insists on."""
        if self._beyond_s[source] < _PATIENCE_S:
            return False
        # Slopes, roofs and valley floors deceive the ground; nothing but a wrong velocity deceives points.
        return source == POINTS or self._accepted_s[POINTS] > _FRESH_S

    def _begin_anew(self, reading: ScaleReading, number: int, surprise: float) -> None:
        lasting = reading.lasting_sigma**2
        if reading.source == GROUND:
            # Either the ground deceives now or it did before: for a while both are as likely.
            lasting += (0.5 * surprise) ** 2
        self._state = np.zeros(3)
        self._state[0] = reading.log_factor
        self._covariance = np.zeros((3, 3))
        self._covariance[0, 0] = lasting + reading.own_sigma**2
        self._covariance[number, number] = lasting
        self._covariance[0, number] = self._covariance[number, 0] = -lasting
        for source in SOURCES:
            self._accepted_s[source] = math.inf

    def _watch_wander(self, readings: list[ScaleReading], passed_s: float) -> None:
        """How fast the scale wanders, from the steps between the points' readings: their lasting error is the
        same in both."""
        reading = next((each for each in readings if each.source == POINTS), None)
        if reading is not None and self._last_points is not None and 0 < passed_s < _WANDER_MEMORY_S:
            step = reading.log_factor - self._last_points
            found = max(step**2 - 2 * _READING_NOISE**2, 0.0) / passed_s
            share = 1.0 - math.exp(-passed_s / _WANDER_MEMORY_S)
            self._wander_variance += share * (min(found, _LARGEST_WANDER**2) - self._wander_variance)
            self._wander_variance = max(self._wander_variance, self._wander**2)
        self._last_points = None if reading is None else reading.log_factor
