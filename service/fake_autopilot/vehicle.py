"""A simple multirotor: it moves sideways only by tilting, and tilting takes time."""

from __future__ import annotations

import math
from dataclasses import dataclass

from uavdepth.attitude import Attitude

GRAVITY_MPS2 = 9.80665
TILT_RADPS = 9.0
"""Natural frequency of the attitude loop: a step in lean angle takes about 0.3 s, as in the recorded
ArduPilot flights."""

TILT_DAMPING = 0.8
CLIMB_LAG_S = 0.15
YAW_LAG_S = 0.15
MAX_STEP_S = 0.02


@dataclass(frozen=True)
class Demand:
    """What a flight controller asks of the motors.

    Args:
        north_mps2, east_mps2: horizontal acceleration wanted.
        climb_mps2: upward acceleration wanted.
        yaw_rate_rps: rate of turn wanted, clockwise, radians per second.
    """

    north_mps2: float = 0.0
    east_mps2: float = 0.0
    climb_mps2: float = 0.0
    yaw_rate_rps: float = 0.0


class Multirotor:
    """Position, velocity and attitude of a vehicle without wind, stepped in time.

    Args:
        position_ned_m: start, metres.
        yaw_rad: start heading.
        drag_per_s: share of the horizontal speed lost to drag each second.
        max_tilt_rad: largest lean angle.
    """

    def __init__(
        self,
        position_ned_m: tuple[float, float, float] = (0.0, 0.0, 0.0),
        yaw_rad: float = 0.0,
        drag_per_s: float = 0.1,
        max_tilt_rad: float = math.radians(30.0),
    ) -> None:
        self.north_m, self.east_m, self.down_m = position_ned_m
        self.velocity_north_mps = self.velocity_east_mps = self.velocity_down_mps = 0.0
        self.roll_rad = self.pitch_rad = 0.0
        self.yaw_rad = yaw_rad
        self.roll_rate_rps = self.pitch_rate_rps = self.yaw_rate_rps = 0.0
        self.drag_per_s = drag_per_s
        self.max_tilt_rad = max_tilt_rad
        self.floor_down_m = position_ned_m[2]
        self.landed = True
        self._climb_mps2 = 0.0

    @property
    def position_ned_m(self) -> tuple[float, float, float]:
        return (self.north_m, self.east_m, self.down_m)

    @property
    def velocity_ned_mps(self) -> tuple[float, float, float]:
        return (self.velocity_north_mps, self.velocity_east_mps, self.velocity_down_mps)

    @property
    def attitude(self) -> Attitude:
        return Attitude(self.roll_rad, self.pitch_rad, self.yaw_rad)

    @property
    def body_velocity_mps(self) -> tuple[float, float]:
        """Speed along the nose's horizontal direction and to its right."""
        cos_yaw, sin_yaw = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        return (
            self.velocity_north_mps * cos_yaw + self.velocity_east_mps * sin_yaw,
            -self.velocity_north_mps * sin_yaw + self.velocity_east_mps * cos_yaw,
        )

    def to_north_east(self, forward: float, right: float) -> tuple[float, float]:
        """Turn a horizontal vector from the heading frame into north and east."""
        cos_yaw, sin_yaw = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        return forward * cos_yaw - right * sin_yaw, forward * sin_yaw + right * cos_yaw

    def step(self, dt_s: float, demand: Demand | None) -> None:
        """Fly for `dt_s`, in pieces of at most 20 ms; without a demand the motors stand still."""
        pieces = max(1, math.ceil(dt_s / MAX_STEP_S - 1e-9))
        for _ in range(pieces):
            self._piece(dt_s / pieces, demand)

    def stop(self) -> None:
        """Lose all speed at once, as on hitting something."""
        self.velocity_north_mps = self.velocity_east_mps = self.velocity_down_mps = 0.0

    def _piece(self, dt_s: float, demand: Demand | None) -> None:
        wanted = demand or Demand()
        self._tilt(dt_s, wanted)
        self.yaw_rate_rps += (wanted.yaw_rate_rps - self.yaw_rate_rps) * min(dt_s / YAW_LAG_S, 1.0)
        self.yaw_rad = _wrapped(self.yaw_rad + self.yaw_rate_rps * dt_s)
        if demand is None:
            forward, right, self._climb_mps2 = 0.0, 0.0, -GRAVITY_MPS2
        else:
            forward = -GRAVITY_MPS2 * math.tan(self.pitch_rad)
            right = GRAVITY_MPS2 * math.tan(self.roll_rad) / math.cos(self.pitch_rad)
            self._climb_mps2 += (wanted.climb_mps2 - self._climb_mps2) * min(dt_s / CLIMB_LAG_S, 1.0)
        north, east = self.to_north_east(forward, right)
        self.velocity_north_mps += (north - self.drag_per_s * self.velocity_north_mps) * dt_s
        self.velocity_east_mps += (east - self.drag_per_s * self.velocity_east_mps) * dt_s
        self.velocity_down_mps -= self._climb_mps2 * dt_s
        self.north_m += self.velocity_north_mps * dt_s
        self.east_m += self.velocity_east_mps * dt_s
        self.down_m += self.velocity_down_mps * dt_s
        self._touch_ground()

    def _tilt(self, dt_s: float, wanted: Demand) -> None:
        cos_yaw, sin_yaw = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        forward = wanted.north_mps2 * cos_yaw + wanted.east_mps2 * sin_yaw
        right = -wanted.north_mps2 * sin_yaw + wanted.east_mps2 * cos_yaw
        limit = GRAVITY_MPS2 * math.tan(self.max_tilt_rad)
        size = math.hypot(forward, right)
        if size > limit:
            forward, right = forward * limit / size, right * limit / size
        pitch_wanted = -math.atan2(forward, GRAVITY_MPS2)
        roll_wanted = math.atan2(right * math.cos(pitch_wanted), GRAVITY_MPS2)
        self.pitch_rate_rps += _tilt_acceleration(pitch_wanted - self.pitch_rad, self.pitch_rate_rps) * dt_s
        self.pitch_rad += self.pitch_rate_rps * dt_s
        self.roll_rate_rps += _tilt_acceleration(roll_wanted - self.roll_rad, self.roll_rate_rps) * dt_s
        self.roll_rad += self.roll_rate_rps * dt_s

    def _touch_ground(self) -> None:
        if self.down_m < self.floor_down_m:
            self.landed = False
            return
        self.down_m = self.floor_down_m
        if self.velocity_down_mps >= 0.0:
            self.landed = True
            self.stop()
            self.roll_rad = self.pitch_rad = self.roll_rate_rps = self.pitch_rate_rps = 0.0


def _tilt_acceleration(missing_rad: float, rate_rps: float) -> float:
    return TILT_RADPS**2 * missing_rad - 2.0 * TILT_DAMPING * TILT_RADPS * rate_rps


def _wrapped(angle_rad: float) -> float:
    return math.remainder(angle_rad, 2.0 * math.pi)
