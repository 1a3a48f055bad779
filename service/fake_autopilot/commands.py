"""What the fake autopilots do on command: COMMAND_LONG and COMMAND_INT, modes, sticks, velocity targets."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.fake_autopilot.controller import Controller, Sticks
from service.fake_autopilot.obstacle_words import ObstacleWords
from service.fake_autopilot.px4 import Px4
from service.fake_autopilot.streams import StreamSchedule
from service.fake_autopilot.telemetry_messages import BUILDERS, HOME_ALTITUDE_M, autopilot_version

if TYPE_CHECKING:
    from service.fake_autopilot.autopilot import SimulatedAutopilot

COMPONENT_ID = int(mavlink.MAV_COMP_ID_AUTOPILOT1)
FORCE_MAGIC = 21196
REBOOT_AUTOPILOT = 1
STICK_MIDDLE_US, STICK_TRAVEL_US, STICK_DEAD_ZONE_US = 1500, 500, 30
BODY_FRAMES = (mavlink.MAV_FRAME_BODY_NED, mavlink.MAV_FRAME_BODY_OFFSET_NED, mavlink.MAV_FRAME_BODY_FRD)

ACCEPTED = int(mavlink.MAV_RESULT_ACCEPTED)
DENIED = int(mavlink.MAV_RESULT_DENIED)
UNSUPPORTED = int(mavlink.MAV_RESULT_UNSUPPORTED)


@dataclass(frozen=True)
class Answer:
    """What a command leads to on its link.

    Args:
        result: MAV_RESULT of the COMMAND_ACK.
        messages: sent after it.
        requested: ids of messages to build and send once.
        interval: a message id and its interval in microseconds, to be honoured once start-up is over.
    """

    result: int
    messages: list[Any] = field(default_factory=list)
    requested: tuple[int, ...] = ()
    interval: tuple[int, float] | None = None


def answer_command(autopilot: SimulatedAutopilot, streams: StreamSchedule, message: Any) -> Answer:
    """Carry a COMMAND_LONG or COMMAND_INT out."""
    handler = _COMMANDS.get(message.command)
    return Answer(UNSUPPORTED) if handler is None else handler(autopilot, streams, message)


def obey(controller: Controller, kind: str, message: Any) -> None:
    """Act on a message that is not answered; other kinds are not looked at."""
    if kind == "OBSTACLE_DISTANCE":
        controller.obstacles(ObstacleWords.from_message(message))
    elif kind == "SET_MODE":
        controller.set_custom_mode(int(message.custom_mode))
    elif kind == "SET_POSITION_TARGET_LOCAL_NED":
        _velocity_target(controller, message)
    elif kind == "RC_CHANNELS_OVERRIDE":
        controller.set_sticks(
            Sticks(
                forward=-_stick(message.chan2_raw),
                right=_stick(message.chan1_raw),
                up=_stick(message.chan3_raw),
                yaw=_stick(message.chan4_raw),
            )
        )
    elif kind == "MANUAL_CONTROL":
        controller.set_sticks(
            Sticks(_axis(message.x), _axis(message.y), _axis(2 * message.z - 1000), _axis(message.r))
        )


def _velocity_target(controller: Controller, message: Any) -> None:
    """Velocity and rate of turn; a target that ignores velocity is not modelled and changes nothing."""
    mask = message.type_mask
    ignored = (
        mavlink.POSITION_TARGET_TYPEMASK_VX_IGNORE
        | mavlink.POSITION_TARGET_TYPEMASK_VY_IGNORE
        | mavlink.POSITION_TARGET_TYPEMASK_VZ_IGNORE
    )
    values = (message.vx, message.vy, message.vz)
    if mask & ignored or not all(math.isfinite(value) for value in values):
        return
    north, east = message.vx, message.vy
    if message.coordinate_frame in BODY_FRAMES:
        north, east = controller.vehicle.to_north_east(message.vx, message.vy)
    ignores_turn = bool(mask & mavlink.POSITION_TARGET_TYPEMASK_YAW_RATE_IGNORE)
    turn = 0.0 if ignores_turn or not math.isfinite(message.yaw_rate) else message.yaw_rate
    controller.set_velocity(north, east, message.vz, turn)


def _stick(pulse_us: int) -> float:
    """RC pulse to -1..1; 0 and 65535 mean that the override leaves the channel alone: centred."""
    if pulse_us in (0, 65535):
        return 0.0
    offset = pulse_us - STICK_MIDDLE_US
    size = max(abs(offset) - STICK_DEAD_ZONE_US, 0) / (STICK_TRAVEL_US - STICK_DEAD_ZONE_US)
    return math.copysign(min(size, 1.0), offset)


def _axis(value: int) -> float:
    """MANUAL_CONTROL's -1000..1000 to -1..1; 32767 is an axis that is not there."""
    return 0.0 if abs(value) > 1000 else value / 1000.0


def _arm(autopilot: SimulatedAutopilot, streams: StreamSchedule, message: Any) -> Answer:
    controller = autopilot.controller
    if message.param1 >= 0.5:
        return Answer(controller.arm())
    return Answer(controller.disarm(force=round(message.param2) == FORCE_MAGIC))


def _takeoff(autopilot: SimulatedAutopilot, streams: StreamSchedule, message: Any) -> Answer:
    controller = autopilot.controller
    height_m = message.z if message.get_type() == "COMMAND_INT" else message.param7
    if isinstance(controller, Px4):
        # PX4 takes an altitude above sea level here, ArduPilot a height above home.
        absolute = math.isfinite(height_m) and height_m > 0.0
        home_m = HOME_ALTITUDE_M - controller.home_down_m
        height_m = height_m - home_m if absolute else controller.parameters["MIS_TAKEOFF_ALT"]
    return Answer(controller.takeoff(height_m))


def _land(autopilot: SimulatedAutopilot, streams: StreamSchedule, message: Any) -> Answer:
    controller = autopilot.controller
    return Answer(controller.set_mode("AUTO.LAND" if isinstance(controller, Px4) else "LAND"))


def _mode(autopilot: SimulatedAutopilot, streams: StreamSchedule, message: Any) -> Answer:
    controller = autopilot.controller
    main, sub = int(message.param2), int(message.param3)
    return Answer(controller.set_custom_mode(main << 16 | sub << 24 if isinstance(controller, Px4) else main))


def _set_interval(autopilot: SimulatedAutopilot, streams: StreamSchedule, message: Any) -> Answer:
    message_id = int(message.param1)
    is_px4 = isinstance(autopilot.controller, Px4)
    if message_id == mavlink.MAVLINK_MSG_ID_OBSTACLE_DISTANCE and not is_px4:
        return Answer(DENIED)  # ArduPilot never makes that message itself (measured)
    if message_id not in BUILDERS:
        return Answer(DENIED)
    return Answer(ACCEPTED, interval=(message_id, float(message.param2)))


def _get_interval(autopilot: SimulatedAutopilot, streams: StreamSchedule, message: Any) -> Answer:
    message_id = int(message.param1)
    return Answer(
        ACCEPTED, [mavlink.MAVLink_message_interval_message(message_id, streams.interval_us(message_id))]
    )


def _request(autopilot: SimulatedAutopilot, streams: StreamSchedule, message: Any) -> Answer:
    message_id = int(message.param1)
    if message_id == mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION:
        return Answer(ACCEPTED, [autopilot_version(autopilot.controller)])
    if message_id not in BUILDERS:
        return Answer(UNSUPPORTED)
    return Answer(ACCEPTED, requested=(message_id,))


def _capabilities(autopilot: SimulatedAutopilot, streams: StreamSchedule, message: Any) -> Answer:
    return Answer(ACCEPTED, [autopilot_version(autopilot.controller)])


def _reboot(autopilot: SimulatedAutopilot, streams: StreamSchedule, message: Any) -> Answer:
    if int(message.param1) != REBOOT_AUTOPILOT:
        return Answer(DENIED)
    autopilot.reboot()
    return Answer(ACCEPTED)


_COMMANDS: dict[int, Callable[[SimulatedAutopilot, StreamSchedule, Any], Answer]] = {
    mavlink.MAV_CMD_COMPONENT_ARM_DISARM: _arm,
    mavlink.MAV_CMD_NAV_TAKEOFF: _takeoff,
    mavlink.MAV_CMD_NAV_LAND: _land,
    mavlink.MAV_CMD_DO_SET_MODE: _mode,
    mavlink.MAV_CMD_SET_MESSAGE_INTERVAL: _set_interval,
    mavlink.MAV_CMD_GET_MESSAGE_INTERVAL: _get_interval,
    mavlink.MAV_CMD_REQUEST_MESSAGE: _request,
    mavlink.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES: _capabilities,
    mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN: _reboot,
}
