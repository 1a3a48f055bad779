"""What the autopilot knew at one moment."""

from __future__ import annotations

from dataclasses import dataclass

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
    """

    at_ns: int
    attitude: Attitude | None = None
    height_m: float | None = None
    position_ned_m: tuple[float, float, float] | None = None
    velocity_ned_mps: tuple[float, float, float] | None = None
    armed: bool | None = None
    mode: str | None = None
    epoch: int = 0
