"""Rows of a flight log as the MAVLink that the autopilot would have sent: replays run through the link."""

from __future__ import annotations

import math
from dataclasses import dataclass

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.replay.footage import Packets

_RANGE_LIMIT_CM = 65_535


@dataclass(frozen=True)
class _Sent:
    boot_us: int
    data: bytes


class TelemetryWriter:
    """Makes packets of one vehicle.

    Args:
        autopilot: MAV_AUTOPILOT of its heartbeats.
    """

    def __init__(self, autopilot: int) -> None:
        self._autopilot = autopilot
        self._codec = mavlink.MAVLink(None, srcSystem=1, srcComponent=1)
        self._sent: list[_Sent] = []

    def heartbeat(self, boot_us: int, custom_mode: int, *, armed: bool) -> None:
        """A HEARTBEAT of a multicopter."""
        flags = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
        flags |= mavlink.MAV_MODE_FLAG_SAFETY_ARMED if armed else 0
        self._send(
            boot_us,
            mavlink.MAVLink_heartbeat_message(
                mavlink.MAV_TYPE_QUADROTOR, self._autopilot, flags, custom_mode, mavlink.MAV_STATE_ACTIVE, 3
            ),
        )

    def attitude(
        self,
        boot_us: int,
        angles_rad: tuple[float, float, float],
        rates_rps: tuple[float, float, float] = (0.0, 0.0, 0.0),
    ) -> None:
        """An ATTITUDE; a number that is not finite makes none."""
        if all(map(math.isfinite, (*angles_rad, *rates_rps))):
            self._send(boot_us, mavlink.MAVLink_attitude_message(_boot_ms(boot_us), *angles_rad, *rates_rps))

    def position(
        self,
        boot_us: int,
        position_ned_m: tuple[float, float, float],
        velocity_ned_mps: tuple[float, float, float],
    ) -> None:
        """A LOCAL_POSITION_NED; a number that is not finite makes none."""
        values = (*position_ned_m, *velocity_ned_mps)
        if all(map(math.isfinite, values)):
            self._send(boot_us, mavlink.MAVLink_local_position_ned_message(_boot_ms(boot_us), *values))

    def height(self, boot_us: int, range_m: float, *, valid: bool, max_m: float = 100.0) -> None:
        """A DISTANCE_SENSOR that looks down."""
        reading = range_m if math.isfinite(range_m) and range_m > 0 else 0.0
        centimetres = min(round(reading * 100), _RANGE_LIMIT_CM)
        self._send(
            boot_us,
            mavlink.MAVLink_distance_sensor_message(
                _boot_ms(boot_us),
                1,
                min(round(max_m * 100), _RANGE_LIMIT_CM),
                centimetres,
                mavlink.MAV_DISTANCE_SENSOR_LASER,
                0,
                mavlink.MAV_SENSOR_ROTATION_PITCH_270,
                255,
                signal_quality=100 if valid and reading > 0 else 1,
            ),
        )

    def packets(self) -> list[Packets]:
        """Everything, in order of time; times are nanoseconds since the autopilot's boot."""
        ordered = sorted(self._sent, key=lambda sent: sent.boot_us)
        return [Packets(sent.boot_us * 1000, sent.data) for sent in ordered]

    def _send(self, boot_us: int, message: mavlink.MAVLink_message) -> None:
        if boot_us >= 0:
            self._sent.append(_Sent(boot_us, bytes(message.pack(self._codec))))
            self._codec.seq = (self._codec.seq + 1) % 256


def _boot_ms(boot_us: int) -> int:
    return (boot_us // 1000) % 2**32
