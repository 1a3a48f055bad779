"""The telemetry messages of a simulated vehicle, each made from its state at one moment."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.fake_autopilot.ardupilot import ArduPilot
from service.fake_autopilot.controller import Controller
from service.fake_autopilot.px4 import Px4

HOME_LATITUDE_DEG, HOME_LONGITUDE_DEG, HOME_ALTITUDE_M = -35.363262, 149.165237, 584.0
METRES_PER_DEGREE = 111_319.5
RANGEFINDER_MIN_CM, RANGEFINDER_MAX_CM = 20, 5000
FIRST_ECHO_ID = 10

Builder = Callable[[Controller, float, int], list[Any]]
"""From a controller, boot seconds and wall microseconds to the messages of one kind; empty where there are
none now."""


def _heartbeat(controller: Controller, boot_s: float, unix_us: int) -> list[Any]:
    armed = mavlink.MAV_MODE_FLAG_SAFETY_ARMED if controller.armed else 0
    if controller.collided:
        status = mavlink.MAV_STATE_EMERGENCY
    elif controller.armed and not controller.vehicle.landed:
        status = mavlink.MAV_STATE_ACTIVE
    else:
        status = mavlink.MAV_STATE_STANDBY
    return [
        mavlink.MAVLink_heartbeat_message(
            mavlink.MAV_TYPE_QUADROTOR,
            controller.autopilot,
            controller.base_mode() | armed,
            controller.modes[controller.mode],
            status,
            3,
        )
    ]


def _attitude(controller: Controller, boot_s: float, unix_us: int) -> list[Any]:
    v = controller.vehicle
    return [
        mavlink.MAVLink_attitude_message(
            _ms(boot_s), v.roll_rad, v.pitch_rad, v.yaw_rad, v.roll_rate_rps, v.pitch_rate_rps, v.yaw_rate_rps
        )
    ]


def _local_position(controller: Controller, boot_s: float, unix_us: int) -> list[Any]:
    if not controller.position_is_known:
        return []
    v = controller.vehicle
    return [mavlink.MAVLink_local_position_ned_message(_ms(boot_s), *v.position_ned_m, *v.velocity_ned_mps)]


def _global_position(controller: Controller, boot_s: float, unix_us: int) -> list[Any]:
    v = controller.vehicle
    latitude, longitude = _latitude_longitude(v.north_m, v.east_m)
    return [
        mavlink.MAVLink_global_position_int_message(
            _ms(boot_s),
            latitude,
            longitude,
            round((HOME_ALTITUDE_M - v.down_m) * 1000),
            round(controller.height_m * 1000),
            round(v.velocity_north_mps * 100),
            round(v.velocity_east_mps * 100),
            round(v.velocity_down_mps * 100),
            round(_heading_deg(controller) * 100) % 36000,
        )
    ]


def _vfr_hud(controller: Controller, boot_s: float, unix_us: int) -> list[Any]:
    v = controller.vehicle
    speed = math.hypot(v.velocity_north_mps, v.velocity_east_mps)
    return [
        mavlink.MAVLink_vfr_hud_message(
            speed,
            speed,
            round(_heading_deg(controller)) % 360,
            36 if controller.armed else 0,
            HOME_ALTITUDE_M - v.down_m,
            -v.velocity_down_mps,
        )
    ]


def _sys_status(controller: Controller, boot_s: float, unix_us: int) -> list[Any]:
    basics = mavlink.MAV_SYS_STATUS_SENSOR_3D_GYRO | mavlink.MAV_SYS_STATUS_SENSOR_3D_ACCEL
    present = basics | mavlink.MAV_SYS_STATUS_SENSOR_PROXIMITY
    health = present if controller.proximity_is_healthy else basics
    return [
        mavlink.MAVLink_sys_status_message(present, present, health, 100, 12600, 500, 90, 0, 0, 0, 0, 0, 0)
    ]


def _system_time(controller: Controller, boot_s: float, unix_us: int) -> list[Any]:
    return [mavlink.MAVLink_system_time_message(unix_us, _ms(boot_s))]


def _distance_sensors(controller: Controller, boot_s: float, unix_us: int) -> list[Any]:
    """The downward rangefinder, and with ArduPilot the echo of the obstacle messages."""
    distance_cm = controller.rangefinder_m() * 100.0
    reading = round(distance_cm) if distance_cm < RANGEFINDER_MAX_CM else RANGEFINDER_MAX_CM + 1
    messages = [
        _distance_sensor(
            boot_s,
            0,
            mavlink.MAV_SENSOR_ROTATION_PITCH_270,
            4,
            reading,
            RANGEFINDER_MIN_CM,
            RANGEFINDER_MAX_CM,
        )
    ]
    if isinstance(controller, ArduPilot):
        messages += [
            _distance_sensor(
                boot_s,
                FIRST_ECHO_ID + echo.face,
                echo.face,
                mavlink.MAV_DISTANCE_SENSOR_LASER,
                echo.distance_cm,
                echo.min_distance_cm,
                echo.max_distance_cm,
            )
            for echo in controller.echo
        ]
    return messages


def _fused_map(controller: Controller, boot_s: float, unix_us: int) -> list[Any]:
    """PX4's own map; only while Collision Prevention runs."""
    if not isinstance(controller, Px4) or not controller.prevention_is_running:
        return []
    known = controller.collision_prevention.map
    return [
        mavlink.MAVLink_obstacle_distance_message(
            round(boot_s * 1e6),
            mavlink.MAV_DISTANCE_SENSOR_LASER,
            list(known.distances_cm),
            0,
            known.min_distance_cm,
            known.max_distance_cm,
            5.0,
            0.0,
            mavlink.MAV_FRAME_BODY_FRD,
        )
    ]


def _gps(controller: Controller, boot_s: float, unix_us: int) -> list[Any]:
    v = controller.vehicle
    latitude, longitude = _latitude_longitude(v.north_m, v.east_m)
    speed = math.hypot(v.velocity_north_mps, v.velocity_east_mps)
    course = math.degrees(math.atan2(v.velocity_east_mps, v.velocity_north_mps)) % 360.0
    altitude = round((HOME_ALTITUDE_M - v.down_m) * 1000)
    return [
        mavlink.MAVLink_gps_raw_int_message(
            round(boot_s * 1e6),
            mavlink.GPS_FIX_TYPE_3D_FIX,
            latitude,
            longitude,
            altitude,
            121,
            200,
            round(speed * 100),
            round(course * 100) % 36000,
            10,
        )
    ]


def autopilot_version(controller: Controller) -> Any:
    """AUTOPILOT_VERSION: MAVLink 2, whole commands, position targets; the version that is imitated."""
    capabilities = (
        mavlink.MAV_PROTOCOL_CAPABILITY_MAVLINK2
        | mavlink.MAV_PROTOCOL_CAPABILITY_COMMAND_INT
        | mavlink.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_LOCAL_NED
    )
    nothing = [0] * 8
    return mavlink.MAVLink_autopilot_version_message(
        capabilities, controller.version_word, 0, 0, 0, nothing, nothing, nothing, 0, 0, controller.system_id
    )


BUILDERS: Mapping[int, Builder] = {
    mavlink.MAVLINK_MSG_ID_HEARTBEAT: _heartbeat,
    mavlink.MAVLINK_MSG_ID_ATTITUDE: _attitude,
    mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: _local_position,
    mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: _global_position,
    mavlink.MAVLINK_MSG_ID_VFR_HUD: _vfr_hud,
    mavlink.MAVLINK_MSG_ID_SYS_STATUS: _sys_status,
    mavlink.MAVLINK_MSG_ID_SYSTEM_TIME: _system_time,
    mavlink.MAVLINK_MSG_ID_DISTANCE_SENSOR: _distance_sensors,
    mavlink.MAVLINK_MSG_ID_OBSTACLE_DISTANCE: _fused_map,
    mavlink.MAVLINK_MSG_ID_GPS_RAW_INT: _gps,
}

DEFAULT_RATES_HZ: Mapping[int, float] = {
    mavlink.MAVLINK_MSG_ID_HEARTBEAT: 1.0,
    mavlink.MAVLINK_MSG_ID_ATTITUDE: 4.0,
    mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: 2.0,
    mavlink.MAVLINK_MSG_ID_SYS_STATUS: 1.0,
    mavlink.MAVLINK_MSG_ID_SYSTEM_TIME: 1.0,
    mavlink.MAVLINK_MSG_ID_VFR_HUD: 1.0,
    mavlink.MAVLINK_MSG_ID_OBSTACLE_DISTANCE: 10.0,
}
"""Low until asked for: nothing that a companion needs comes fast enough by itself. PX4's fused map comes
unasked."""


def _distance_sensor(
    boot_s: float, sensor_id: int, orientation: int, kind: int, distance_cm: int, min_cm: int, max_cm: int
) -> Any:
    return mavlink.MAVLink_distance_sensor_message(
        _ms(boot_s), min_cm, max_cm, min(distance_cm, 65535), kind, sensor_id, orientation, 0
    )


def _ms(boot_s: float) -> int:
    return int(boot_s * 1000.0 + 1e-6) % 2**32


def _heading_deg(controller: Controller) -> float:
    return math.degrees(controller.vehicle.yaw_rad) % 360.0


def _latitude_longitude(north_m: float, east_m: float) -> tuple[int, int]:
    """1e7 degrees on a locally flat Earth round the home position."""
    latitude = HOME_LATITUDE_DEG + north_m / METRES_PER_DEGREE
    shrink = math.cos(math.radians(HOME_LATITUDE_DEG))
    longitude = HOME_LONGITUDE_DEG + east_m / (METRES_PER_DEGREE * shrink)
    return round(latitude * 1e7), round(longitude * 1e7)
