"""What the autopilot knew at one moment."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from uavdepth.attitude import Attitude


@dataclass(frozen=True)
class Telemetry:
    """The vehicle at `at_ns`; a value that was not heard, or is too old to trust, is None.

    Args:
        at_ns: the time that these values hold for, on the service's clock.
        attitude: interpolated attitude.
        height_m: height above ground from the downward rangefinder (orientation 25), metres.
        position_ned_m: position in the autopilot's local frame, metres.
        velocity_ned_mps: velocity, metres per second.
        armed: motors armed, from HEARTBEAT.
        mode: the autopilot's flight mode by name, from HEARTBEAT.
        epoch: changes when the autopilot has rebooted or its clock was taken anew: what was said in another
            epoch does not belong to this one.
        heading_shift_rad: how far resets of the autopilot's heading have turned north for it in this epoch,
            radians clockwise; yaw, position and velocity are told in the frame so turned.
    """

    at_ns: int
    attitude: Attitude | None = None
    height_m: float | None = None
    position_ned_m: tuple[float, float, float] | None = None
    velocity_ned_mps: tuple[float, float, float] | None = None
    armed: bool | None = None
    mode: str | None = None
    epoch: int = 0
    heading_shift_rad: float = 0.0

    @property
    def steady(self) -> Telemetry:
        """The same in a frame that no reset of the heading turns: in it yaw changes as the nose turns.

        Only turns and ways between two moments mean anything in it; position jumps where heading is reset.
        """
        shift_rad = self.heading_shift_rad
        if shift_rad == 0.0:
            return self
        attitude, position, velocity = self.attitude, self.position_ned_m, self.velocity_ned_mps
        if attitude is not None:
            attitude = replace(attitude, yaw_rad=math.remainder(attitude.yaw_rad - shift_rad, math.tau))
        return replace(
            self,
            attitude=attitude,
            position_ned_m=None if position is None else _turned_back(position, shift_rad),
            velocity_ned_mps=None if velocity is None else _turned_back(velocity, shift_rad),
            heading_shift_rad=0.0,
        )


def _turned_back(vector: tuple[float, float, float], angle_rad: float) -> tuple[float, float, float]:
    north, east, down = vector
    cosine, sine = math.cos(angle_rad), math.sin(angle_rad)
    return cosine * north + sine * east, cosine * east - sine * north, down
