"""The messages by which a ground station moves a vehicle ahead."""

from __future__ import annotations

import math
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.fake_autopilot.commands import STICK_DEAD_ZONE_US, STICK_MIDDLE_US, STICK_TRAVEL_US

TARGET_COMPONENT = 1
CENTRED_THROTTLE = 500
VELOCITY_MASK = (
    mavlink.POSITION_TARGET_TYPEMASK_X_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_Y_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_Z_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_AX_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_AY_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_AZ_IGNORE
    | mavlink.POSITION_TARGET_TYPEMASK_YAW_IGNORE
)


def manual_control(system_id: int, forward: float) -> Any:
    """MANUAL_CONTROL with the stick forward by a share of -1 to 1, the rest centred."""
    return mavlink.MAVLink_manual_control_message(system_id, round(forward * 1000), 0, CENTRED_THROTTLE, 0, 0)


def rc_override(system_id: int, forward: float) -> Any:
    """RC_CHANNELS_OVERRIDE with the pitch stick forward (a low pulse) by -1 to 1, the rest centred."""
    pitch_us = STICK_MIDDLE_US
    if forward != 0.0:
        size = STICK_DEAD_ZONE_US + abs(forward) * (STICK_TRAVEL_US - STICK_DEAD_ZONE_US)
        pitch_us = round(STICK_MIDDLE_US - math.copysign(size, forward))
    middle = STICK_MIDDLE_US
    return mavlink.MAVLink_rc_channels_override_message(
        system_id, TARGET_COMPONENT, middle, pitch_us, middle, middle, 0, 0, 0, 0
    )


def body_velocity(system_id: int, forward_mps: float) -> Any:
    """SET_POSITION_TARGET_LOCAL_NED with a velocity along the nose and no turn."""
    nothing = (0.0, 0.0, 0.0)
    velocity = (forward_mps, 0.0, 0.0)
    return mavlink.MAVLink_set_position_target_local_ned_message(
        0,
        system_id,
        TARGET_COMPONENT,
        mavlink.MAV_FRAME_BODY_NED,
        VELOCITY_MASK,
        *nothing,
        *velocity,
        *nothing,
        0.0,
        0.0,
    )
