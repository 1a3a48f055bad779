"""Attitude, position and height at a moment between messages."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from service.autopilot.heading_reset import heading_reset
from service.autopilot.history import History, Value
from service.autopilot.quaternion import Quaternion, from_attitude, headed, slerp, to_attitude, turned
from service.settings.autopilot import AutopilotSettings
from uavdepth.attitude import Attitude

Vector = tuple[float, float, float]

MAX_TILT_RAD = math.radians(45.0)
"""Beyond it the rangefinder's beam meets the ground too far away to be called height."""

_SAME_SURFACE_M = 0.3
_SAME_SURFACE_RATIO = 0.1
"""Two readings that differ by more than 0.3 m + 10 % lie on different surfaces: nothing is in between."""


@dataclass(frozen=True)
class MotionLimits:
    """How far from a message its words still hold.

    Args:
        gap_ns: widest gap between two messages that is interpolated.
        extrapolation_ns: furthest that attitude and position are carried by their rates.
        height_ns: furthest that a rangefinder reading is carried.
    """

    gap_ns: int = 200_000_000
    extrapolation_ns: int = 50_000_000
    height_ns: int = 500_000_000

    @classmethod
    def of(cls, settings: AutopilotSettings) -> MotionLimits:
        """The limits that the `[autopilot]` section sets."""
        return cls(
            gap_ns=round(settings.attitude_gap_s * 1e9),
            extrapolation_ns=round(settings.extrapolation_s * 1e9),
            height_ns=round(settings.height_timeout_s * 1e9),
        )


@dataclass(frozen=True)
class _Turning:
    quaternion: Quaternion
    body_rates_rps: Vector
    heading_shift_rad: float = 0.0


@dataclass(frozen=True)
class _Moving:
    position_ned_m: Vector
    velocity_ned_mps: Vector


class MotionHistory:
    """What the autopilot said of its motion lately, by its own clock (nanoseconds since boot)."""

    def __init__(self, limits: MotionLimits) -> None:
        self._limits = limits
        self._attitudes: History[_Turning] = History()
        self._positions: History[_Moving] = History()
        self._ranges: History[float | None] = History()

    def clear(self) -> None:
        """Forget everything: the clock that the stamps belong to has changed."""
        self._attitudes.clear()
        self._positions.clear()
        self._ranges.clear()

    def add_attitude(self, boot_ns: int, attitude: Attitude, body_rates_rps: Vector) -> bool:
        """Add an ATTITUDE; False (and nothing added) if a number is not finite."""
        angles = (attitude.roll_rad, attitude.pitch_rad, attitude.yaw_rad)
        if not all(math.isfinite(value) for value in (*angles, *body_rates_rps)):
            return False
        new = _Turning(from_attitude(attitude), body_rates_rps)
        shift_rad = self._heading_shift(boot_ns, new)
        self._attitudes.add(boot_ns, replace(new, heading_shift_rad=shift_rad))
        return True

    def _heading_shift(self, boot_ns: int, new: _Turning) -> float:
        """How far resets have turned the heading by this message, which may come late."""
        before, after = self._attitudes.around(boot_ns)
        if before is None or before[0] == boot_ns:
            return 0.0 if after is None else after[1].heading_shift_rad
        reset_rad = heading_reset(
            before[1].quaternion,
            before[1].body_rates_rps,
            new.quaternion,
            new.body_rates_rps,
            (boot_ns - before[0]) * 1e-9,
        )
        if reset_rad and after is not None:
            return after[1].heading_shift_rad
        return before[1].heading_shift_rad + reset_rad

    def add_position(self, boot_ns: int, position_ned_m: Vector, velocity_ned_mps: Vector) -> bool:
        """Add a LOCAL_POSITION_NED; False (and nothing added) if a number is not finite."""
        if not all(math.isfinite(value) for value in (*position_ned_m, *velocity_ned_mps)):
            return False
        self._positions.add(boot_ns, _Moving(position_ned_m, velocity_ned_mps))
        return True

    def add_range(self, boot_ns: int, range_m: float | None) -> None:
        """Add a reading of the downward rangefinder, metres along its beam; None for out of range."""
        self._ranges.add(boot_ns, range_m)

    @property
    def newest_attitude_ns(self) -> int | None:
        """Time of the newest attitude."""
        return self._attitudes.newest_ns

    def attitude_at(self, boot_ns: int, carried_ns: int | None = None) -> Attitude | None:
        """Attitude at `boot_ns`, or None where no message is near enough.

        Args:
            carried_ns: furthest that a message is carried by its rates, instead of the limit.
        """
        turning = self._turning_at(boot_ns, carried_ns)
        return None if turning is None else to_attitude(turning[0])

    def heading_shift_at(self, boot_ns: int, carried_ns: int | None = None) -> float:
        """How far resets have turned the heading of `attitude_at` since the first message, radians clockwise;
        0 where that is None."""
        turning = self._turning_at(boot_ns, carried_ns)
        return 0.0 if turning is None else turning[1]

    def _turning_at(self, boot_ns: int, carried_ns: int | None) -> tuple[Quaternion, float] | None:
        """Attitude, and how far resets have turned its heading."""
        before, after = self._attitudes.around(boot_ns)
        if before and after and after[0] - before[0] <= self._limits.gap_ns:
            fraction = (boot_ns - before[0]) / (after[0] - before[0])
            (_, first), (_, last) = before, after
            # A reset is no turn: up to it the nose goes where it would have gone without.
            end = headed(last.quaternion, first.heading_shift_rad - last.heading_shift_rad)
            return slerp(first.quaternion, end, fraction), first.heading_shift_rad
        carried_ns = self._limits.extrapolation_ns if carried_ns is None else carried_ns
        near = _nearer(before, after, boot_ns, carried_ns)
        if near is None:
            return None
        at_ns, turning = near
        carried = turned(turning.quaternion, turning.body_rates_rps, (boot_ns - at_ns) * 1e-9)
        return carried, turning.heading_shift_rad

    def position_at(self, boot_ns: int, carried_ns: int | None = None) -> tuple[Vector, Vector] | None:
        """Position (NED, metres) and velocity (NED, metres a second) at `boot_ns`, or None.

        Args:
            carried_ns: furthest that a message is carried by its velocity, instead of the limit.
        """
        before, after = self._positions.around(boot_ns)
        if before and after and after[0] - before[0] <= self._limits.gap_ns:
            fraction = (boot_ns - before[0]) / (after[0] - before[0])
            return (
                _mix(before[1].position_ned_m, after[1].position_ned_m, fraction),
                _mix(before[1].velocity_ned_mps, after[1].velocity_ned_mps, fraction),
            )
        carried_ns = self._limits.extrapolation_ns if carried_ns is None else carried_ns
        near = _nearer(before, after, boot_ns, carried_ns)
        if near is None:
            return None
        seconds = (boot_ns - near[0]) * 1e-9
        (n, e, d), (vn, ve, vd) = near[1].position_ned_m, near[1].velocity_ned_mps
        return (n + vn * seconds, e + ve * seconds, d + vd * seconds), (vn, ve, vd)

    def height_at(self, boot_ns: int) -> float | None:
        """Height above the ground below at `boot_ns` in metres, or None if it is not known.

        The range along the beam is levelled by the attitude at its own moment.
        """
        before, after = self._ranges.around(boot_ns)
        if before and after and after[0] - before[0] <= self._limits.gap_ns:
            low, high = self._height(*before), self._height(*after)
            if low is None or high is None:
                return None
            if abs(high - low) <= _SAME_SURFACE_M + _SAME_SURFACE_RATIO * max(low, high):
                return low + (high - low) * (boot_ns - before[0]) / (after[0] - before[0])
        near = _nearer(before, after, boot_ns, self._limits.height_ns)
        return self._height(*near) if near is not None else None

    def _height(self, boot_ns: int, range_m: float | None) -> float | None:
        attitude = self.attitude_at(boot_ns)
        if range_m is None or attitude is None:
            return None
        cosine = math.cos(attitude.roll_rad) * math.cos(attitude.pitch_rad)
        return range_m * cosine if cosine >= math.cos(MAX_TILT_RAD) else None


def _nearer(
    before: tuple[int, Value] | None, after: tuple[int, Value] | None, boot_ns: int, limit_ns: int
) -> tuple[int, Value] | None:
    found = [sample for sample in (before, after) if sample and abs(sample[0] - boot_ns) <= limit_ns]
    return min(found, key=lambda sample: abs(sample[0] - boot_ns), default=None)


def _mix(a: Vector, b: Vector, fraction: float) -> Vector:
    x, y, z = (p + (q - p) * fraction for p, q in zip(a, b, strict=True))
    return x, y, z
