"""What the service says of itself in its HEARTBEAT."""

from __future__ import annotations

from enum import IntEnum


class ServiceState(IntEnum):
    """State of the service; the values are MAVLink's MAV_STATE."""

    BOOT = 1
    """Starting: no picture has been measured yet."""
    STANDBY = 3
    """Ready, but depth cannot be trusted or a part is missing: no obstacles are sent."""
    ACTIVE = 4
    """Obstacles are being sent."""
    CRITICAL = 5
    """Something has failed that protected the vehicle until now."""
