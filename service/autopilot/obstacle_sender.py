"""From a scan to the messages that tell it: when one may leave, and in which words."""

from __future__ import annotations

import math
from collections.abc import Sequence

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.autopilot.byte_budget import (
    LEAST_RATE_HZ,
    OBSTACLE_BYTES,
    POINT_BYTES,
    obstacle_rate_hz,
    points_in_a_burst,
)
from service.autopilot.obstacle_gate import ObstacleGate, Refusal
from service.settings.autopilot import AutopilotSettings
from uavdepth.attitude import Attitude
from uavdepth.messages.autopilot_profile import AutopilotProfile
from uavdepth.messages.obstacle_distance import encode_obstacle_distance
from uavdepth.messages.obstacle_points import encode_obstacle_points
from uavdepth.scan.obstacle_scan import ObstacleScan

_FEWEST_POINTS = 24
"""The elements of a camera that sees 120 degrees: with fewer points a wide obstacle would have holes."""


class ObstacleSender:
    """Lets each frame through once, fresh, at the rate that the line carries, with limits that never change.

    Args:
        settings: the `[autopilot]` section.
        bytes_per_s: what the line may carry; 0 for no limit.
    """

    def __init__(self, settings: AutopilotSettings, bytes_per_s: int) -> None:
        points = points_in_a_burst(bytes_per_s)
        self._most_points = points if settings.obstacle_points and points >= _FEWEST_POINTS else 0
        self._lacks_room_for_points = settings.obstacle_points and not self._most_points
        scan_bytes = max(OBSTACLE_BYTES, self._most_points * POINT_BYTES)
        self.rate_hz = obstacle_rate_hz(settings.obstacle_rate_hz, bytes_per_s, scan_bytes)
        """Scans a second at most."""
        self._bytes_per_s = bytes_per_s
        self._gate = ObstacleGate(self.rate_hz, round(settings.max_frame_age_s * 1e9))
        self._limits_m: tuple[float, float] | None = None
        self._points_ms = -1

    @property
    def complaint(self) -> str | None:
        """What is wrong with a line that carries too little; None if it carries enough."""
        if self.rate_hz < LEAST_RATE_HZ:
            return (
                f"the line may carry {self._bytes_per_s} bytes/s, that is {self.rate_hz:.1f} "
                f"OBSTACLE_DISTANCE a second; the vehicle stops in time with {LEAST_RATE_HZ:g}: raise the "
                "baud rate, 57600 at least"
            )
        if self._lacks_room_for_points:
            return (
                f"the line may carry {self._bytes_per_s} bytes/s, too few for obstacle_points (26000): "
                "OBSTACLE_DISTANCE is sent instead"
            )
        return None

    def sends_points(self, profile: AutopilotProfile) -> bool:
        """Whether an autopilot gets OBSTACLE_DISTANCE_3D, and then no OBSTACLE_DISTANCE, which wipes it."""
        return profile.takes_points and self._most_points > 0

    def refusal(
        self,
        scan: ObstacleScan,
        captured_ns: int,
        now_ns: int,
        profile: AutopilotProfile,
        attitude: Attitude | None,
    ) -> Refusal | None:
        """Why the scan of the frame captured at `captured_ns` may not be sent now; None if it may.

        The limits of the first scan hold: PX4 never accepts "clear" again after max was lowered (measured).
        """
        if self._limits_m not in (None, (scan.min_distance_m, scan.max_distance_m)):
            return Refusal.LIMITS_CHANGED
        if self.sends_points(profile) and not _is_known(attitude):
            return Refusal.NO_ATTITUDE
        return self._gate.refusal(captured_ns, now_ns)

    def accept(self, scan: ObstacleScan, captured_ns: int, now_ns: int) -> None:
        """The scan may be sent, and counts as sent."""
        self._limits_m = (scan.min_distance_m, scan.max_distance_m)
        self._gate.passed(captured_ns, now_ns)

    def messages(
        self,
        scan: ObstacleScan,
        captured_ns: int,
        time_usec: int,
        profile: AutopilotProfile,
        attitude: Attitude | None,
    ) -> Sequence[mavlink.MAVLink_message]:
        """The messages for a scan.

        Args:
            time_usec: capture time on the autopilot's clock, 0 where that is not known.
            profile: the autopilot's layout.
            attitude: the vehicle's when the message is read; needed for points.
        """
        if attitude is None or not self.sends_points(profile):
            return [encode_obstacle_distance(scan, time_usec, profile)]
        at_ms = (time_usec // 1000 or captured_ns // 1_000_000) % 2**32
        # A stamp that was used before would join two pictures into one.
        self._points_ms = at_ms if at_ms != self._points_ms else at_ms + 1
        return encode_obstacle_points(scan, attitude, self._points_ms, self._most_points)


def _is_known(attitude: Attitude | None) -> bool:
    return attitude is not None and math.isfinite(attitude.roll_rad + attitude.pitch_rad)
