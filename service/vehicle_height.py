"""How high the vehicle is above the ground, by what the autopilot says."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from service.telemetry import Telemetry
from uavdepth.scale.ground_scale import MIN_HEIGHT_M

HeightSource = Literal["rangefinder", "ekf", "both"]

_RANGE_SIGMA = 0.03
"""Of a reading, relative: sensor, and the time between reading and picture."""

_RANGE_FLOOR_M = 0.1
_HOME_SIGMA_M = 0.5
"""Of the EKF's height above the place that it started from, metres: barometer and take-off spot."""

_SLOPE = 0.05
"""Ground rises or falls by about so much of the way flown away from where its height was known."""

_UNKNOWN_SPEED_MPS = 3.0
"""Taken for the speed where the autopilot says no position."""

_CLIMB_SIGMA_MPS = 0.1
"""How fast the EKF's height drifts against the ground below, metres a second, for some seconds at least."""

_LONGEST_DRIFT_S = 20.0


@dataclass(frozen=True)
class KnownHeight:
    """Height of the vehicle's origin above the ground below it.

    Args:
        height_m: metres, at least `MIN_HEIGHT_M`.
        relative_sigma: one standard deviation over the height.
        age_s: time since the rangefinder said it, seconds; 0 where the EKF does.
        by_rangefinder: whether the rangefinder says it, now or not long ago.
    """

    height_m: float
    relative_sigma: float
    age_s: float
    by_rangefinder: bool


@dataclass(frozen=True)
class _Ground:
    """The ground where its height was known last; positions are the autopilot's, NED, metres."""

    at_ns: int
    sigma_m: float
    position_ned_m: tuple[float, float, float]


class VehicleHeight:
    """The height by rangefinder, held for a while when it falls silent, or by the EKF.

    A held height is moved by the climb since. The EKF's height is that above the ground where the
    rangefinder was last heard, or above the place that the EKF started from: with every metre flown away
    from there it is less certain.

    Args:
        source: "rangefinder", "ekf" or "both".
        hold_s: how long a reading of the rangefinder is held, seconds.
    """

    def __init__(self, source: HeightSource, hold_s: float) -> None:
        self._source = source
        self._hold_ns = hold_s * 1e9
        self.clear()

    def clear(self) -> None:
        """Forget what was heard: the autopilot has started anew."""
        self._reading: Telemetry | None = None
        self._ground: _Ground | None = None

    def at(self, telemetry: Telemetry) -> KnownHeight | None:
        """The height at the telemetry's time, or None where nobody knows it or the vehicle is too low."""
        if self._reading is not None and telemetry.at_ns < self._reading.at_ns:
            self.clear()
        said_m = telemetry.height_m
        if self._source != "ekf" and said_m is not None and said_m < MIN_HEIGHT_M:
            self._reading = None
            return None
        known = None if self._source == "ekf" else self._by_rangefinder(telemetry)
        if known is None and self._source != "rangefinder":
            known = self._by_ekf(telemetry)
        return known

    def _by_rangefinder(self, telemetry: Telemetry) -> KnownHeight | None:
        if telemetry.height_m is not None:
            # A reading that is no height ends what was held.
            good = math.isfinite(telemetry.height_m)
            self._reading = telemetry if good else None
            position = telemetry.position_ned_m
            if good and position is not None and _is_finite(position):
                north_m, east_m, down_m = position
                sigma_m = max(_RANGE_FLOOR_M, _RANGE_SIGMA * telemetry.height_m)
                ground = (north_m, east_m, down_m + telemetry.height_m)
                self._ground = _Ground(telemetry.at_ns, sigma_m, ground)
        reading = self._reading
        if reading is None or reading.height_m is None:
            return None
        age_ns = telemetry.at_ns - reading.at_ns
        if age_ns > self._hold_ns:
            self._reading = None
            return None
        height_m, sigma_m = reading.height_m, max(_RANGE_FLOOR_M, _RANGE_SIGMA * reading.height_m)
        before, now = reading.position_ned_m, telemetry.position_ned_m
        if before is not None and now is not None and _is_finite(before) and _is_finite(now):
            height_m = max(MIN_HEIGHT_M, height_m + before[2] - now[2])
            flown_m = math.hypot(now[0] - before[0], now[1] - before[1])
        else:
            flown_m = _UNKNOWN_SPEED_MPS * age_ns * 1e-9
        sigma_m = math.hypot(sigma_m, _SLOPE * flown_m, _CLIMB_SIGMA_MPS * age_ns * 1e-9)
        return KnownHeight(height_m, sigma_m / height_m, age_ns * 1e-9, by_rangefinder=True)

    def _by_ekf(self, telemetry: Telemetry) -> KnownHeight | None:
        now = telemetry.position_ned_m
        if now is None or not _is_finite(now):
            return None
        sigma_m, ground_ned_m, age_s = _HOME_SIGMA_M, (0.0, 0.0, 0.0), 0.0
        if self._ground is not None and self._source == "both":
            sigma_m, ground_ned_m = self._ground.sigma_m, self._ground.position_ned_m
            age_s = (telemetry.at_ns - self._ground.at_ns) * 1e-9
        height_m = ground_ned_m[2] - now[2]
        if height_m < MIN_HEIGHT_M:
            return None
        flown_m = math.hypot(now[0] - ground_ned_m[0], now[1] - ground_ned_m[1])
        drift_m = _CLIMB_SIGMA_MPS * min(age_s, _LONGEST_DRIFT_S)
        sigma_m = math.hypot(sigma_m, _SLOPE * flown_m, drift_m)
        return KnownHeight(height_m, sigma_m / height_m, 0.0, by_rangefinder=False)


def _is_finite(position_ned_m: tuple[float, float, float]) -> bool:
    return all(math.isfinite(value) for value in position_ned_m)
