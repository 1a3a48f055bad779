"""PX4's Collision Prevention in Position mode: an acceleration that leads into something is not flown.

Behaviour as measured on v1.18; the law between the measurements is ours. Not modelled: the steering round
obstacles within CP_GUIDE_ANG (a way is open if anything within that angle is known; the direction stays),
CP_DELAY (measured to cover little), yaw drift. Position mode only: Altitude, Mission, Return and Offboard
are not looked after.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from service.fake_autopilot.obstacle_map_px4 import BIN_COUNT, BIN_WIDTH_DEG, ObstacleMap
from service.fake_autopilot.obstacle_words import UNKNOWN_WORD

STALE_S = 0.53
"""No horizontal acceleration this long after the last message (measured)."""

HOLD_S = 5.5
"""Switch to Hold this long after the last message (measured: 5.1 to 5.8 s)."""

HOLD_WITHOUT_DATA_S = 5.1
"""The same, counted from entering Position mode without data (measured)."""

PUSH_PER_S2 = 0.7
"""Backward acceleration for each metre inside CP_DIST while the stick points there: 3 s of it gave 4.2 m/s
with 2 m and 8.5 m/s with 4.7 m (measured)."""

SPEED_GAIN_PER_S = 1.0
"""How hard a speed above the stoppable one is braked: fitted so that the kept distance is overshot by half a
metre from 6 m/s (measured 0.8 m)."""

STICK_DEAD_ZONE = 0.02


@dataclass(frozen=True)
class Stick:
    """Horizontal stick in the heading frame, each -1 to 1."""

    forward: float = 0.0
    right: float = 0.0

    @property
    def is_deflected(self) -> bool:
        return math.hypot(self.forward, self.right) > STICK_DEAD_ZONE


class CollisionPrevention:
    """The map and what it allows. Times are seconds of one steady clock.

    Args:
        parameters: live values of CP_DIST, CP_GUIDE_ANG, CP_GO_NO_DATA, MPC_ACC_HOR, MPC_JERK_MAX.
    """

    def __init__(self, parameters: Mapping[str, float]) -> None:
        self.map = ObstacleMap()
        self._parameters = parameters
        self._entered_s = 0.0
        self.setpoint_lost = False

    @property
    def is_on(self) -> bool:
        """CP_DIST above 0."""
        return self._parameters["CP_DIST"] > 0.0

    def enter(self, now_s: float) -> None:
        """Position mode was entered: the map, its remembered ranges and a lost set point are forgotten."""
        self.map.reset()
        self._entered_s = now_s
        self.setpoint_lost = False

    def is_stale(self, now_s: float) -> bool:
        """No message for 0.53 s: the vehicle coasts."""
        return self.map.message_s is None or now_s - self.map.message_s > STALE_S

    def wants_hold(self, now_s: float) -> bool:
        """No message for so long that PX4 asks for Hold (it addresses the request to system 1, whatever its
        own id)."""
        if self.map.message_s is None:
            return now_s - self._entered_s > HOLD_WITHOUT_DATA_S
        return now_s - self.map.message_s > HOLD_S

    def constrain(
        self, acceleration: tuple[float, float], velocity: tuple[float, float], stick: Stick, now_s: float
    ) -> tuple[float, float] | None:
        """Acceleration that may be flown, heading frame, m/s^2; None where PX4's own set point has become
        NaN.

        Args:
            acceleration: wanted, forward and right.
            velocity: flown, forward and right, m/s.
            stick: with the stick centred nothing is changed, and nothing pushes.
        """
        if self.setpoint_lost:
            return None
        if self.is_stale(now_s):
            return 0.0, 0.0
        if not stick.is_deflected:
            return acceleration
        if self._all_known_too_near():
            self.setpoint_lost = True
            return None
        heading_deg = math.degrees(math.atan2(stick.right, stick.forward))
        if not self._may_go(heading_deg):
            return 0.0, 0.0
        return self._braked(acceleration, velocity, heading_deg)

    def _all_known_too_near(self) -> bool:
        known = [word for word in self.map.distances_cm if word != UNKNOWN_WORD]
        return bool(known) and max(known) <= self.map.min_distance_cm

    def _may_go(self, heading_deg: float) -> bool:
        centre = round(heading_deg / BIN_WIDTH_DEG)
        reach = int(self._parameters["CP_GUIDE_ANG"] // BIN_WIDTH_DEG)
        bins = [centre + offset for offset in range(-reach, reach + 1)]
        if any(self.map.distance_m(bin_index) is not None for bin_index in bins):
            return True
        if self._parameters["CP_GO_NO_DATA"] < 1 or not self.map.knows_anything:
            return False
        return not any(self.map.was_ever_known(bin_index) for bin_index in bins)

    def _braked(
        self, acceleration: tuple[float, float], velocity: tuple[float, float], heading_deg: float
    ) -> tuple[float, float]:
        keep_m = max(self._parameters["CP_DIST"], self.map.min_distance_cm / 100.0)
        forward, right = acceleration
        nearest: tuple[float, float, float] | None = None
        for bin_index in range(BIN_COUNT):
            distance_m = self.map.distance_m(bin_index)
            if distance_m is None or math.isinf(distance_m):
                continue
            bearing = math.radians(bin_index * BIN_WIDTH_DEG)
            if math.cos(bearing - math.radians(heading_deg)) <= 0.0:
                continue
            ahead, aside = math.cos(bearing), math.sin(bearing)
            closing = velocity[0] * ahead + velocity[1] * aside
            if distance_m <= keep_m:
                off = abs(math.remainder(math.degrees(bearing) - heading_deg, 360.0))
                if off <= self._parameters["CP_GUIDE_ANG"] and (nearest is None or distance_m < nearest[0]):
                    nearest = (distance_m, ahead, aside)
            limit = self._acceleration_limit(distance_m - keep_m, closing)
            wanted = forward * ahead + right * aside
            if wanted > limit:
                forward -= (wanted - limit) * ahead
                right -= (wanted - limit) * aside
        if nearest is not None:
            distance_m, ahead, aside = nearest
            push = -PUSH_PER_S2 * (keep_m - distance_m)
            wanted = forward * ahead + right * aside
            if wanted > push:
                forward -= (wanted - push) * ahead
                right -= (wanted - push) * aside
        return forward, right

    def _acceleration_limit(self, room_m: float, closing_mps: float) -> float:
        hardest = self._parameters["MPC_ACC_HOR"]
        fastest = stoppable_speed_mps(room_m, hardest, self._parameters["MPC_JERK_MAX"])
        return min(max(SPEED_GAIN_PER_S * (fastest - closing_mps), -hardest), hardest)


def stoppable_speed_mps(room_m: float, acceleration_mps2: float, jerk_mps3: float) -> float:
    """Speed v that v^2 / 2a of braking plus 2a/j of building the braking up brings to rest within
    `room_m`."""
    if room_m <= 0.0:
        return 0.0
    half_lag = 2.0 * acceleration_mps2**2 / jerk_mps3
    return math.sqrt(half_lag**2 + 2.0 * acceleration_mps2 * room_m) - half_lag
