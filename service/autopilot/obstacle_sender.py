"""From a scan to the messages that tell it: when one may leave, and in which words."""

from __future__ import annotations

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.autopilot.byte_budget import LEAST_RATE_HZ, obstacle_rate_hz
from service.autopilot.obstacle_gate import ObstacleGate, Refusal
from service.settings.autopilot import AutopilotSettings
from uavdepth.autopilot_profile import AutopilotProfile
from uavdepth.obstacle_message import encode_obstacle_distance
from uavdepth.obstacle_scan import ObstacleScan


class ObstacleSender:
    """Lets each frame through once, fresh, at the rate that the line carries, with limits that never change.

    Args:
        settings: the `[autopilot]` section.
        bytes_per_s: what the line may carry; 0 for no limit.
    """

    def __init__(self, settings: AutopilotSettings, bytes_per_s: int) -> None:
        self.rate_hz = obstacle_rate_hz(settings.obstacle_rate_hz, bytes_per_s)
        """Messages a second at most."""
        self._bytes_per_s = bytes_per_s
        self._gate = ObstacleGate(self.rate_hz, round(settings.max_frame_age_s * 1e9))
        self._limits_m: tuple[float, float] | None = None

    @property
    def complaint(self) -> str | None:
        """What is wrong with a line that carries too little; None if it carries enough."""
        if self.rate_hz >= LEAST_RATE_HZ:
            return None
        return (
            f"the line may carry {self._bytes_per_s} bytes/s, that is {self.rate_hz:.1f} OBSTACLE_DISTANCE a "
            f"second; the vehicle stops in time with {LEAST_RATE_HZ:g}: raise the baud rate, 57600 at least"
        )

    def refusal(self, scan: ObstacleScan, captured_ns: int, now_ns: int) -> Refusal | None:
        """Why the scan of the frame captured at `captured_ns` may not be sent now; None if it may.

        The limits of the first scan hold: PX4 never accepts "clear" again after max was lowered (measured).
        """
        if self._limits_m not in (None, (scan.min_distance_m, scan.max_distance_m)):
            return Refusal.LIMITS_CHANGED
        return self._gate.refusal(captured_ns, now_ns)

    def messages(
        self, scan: ObstacleScan, captured_ns: int, now_ns: int, time_usec: int, profile: AutopilotProfile
    ) -> list[mavlink.MAVLink_message]:
        """The messages for a scan that may be sent; it counts as sent.

        Args:
            time_usec: capture time on the autopilot's clock, 0 where that is not known.
            profile: the autopilot's layout.
        """
        messages = [encode_obstacle_distance(scan, time_usec, profile)]
        self._limits_m = (scan.min_distance_m, scan.max_distance_m)
        self._gate.passed(captured_ns, now_ns)
        return messages
