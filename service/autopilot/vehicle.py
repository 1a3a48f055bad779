"""Who the autopilot is, learnt from its HEARTBEAT."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass
from enum import Enum

from pymavlink import mavutil
from pymavlink.dialects.v20 import ardupilotmega as mavlink

_AUTOPILOT_COMPONENT = mavlink.MAV_COMP_ID_AUTOPILOT1
_NO_VEHICLE_TYPES = frozenset(
    {
        mavlink.MAV_TYPE_GCS,
        mavlink.MAV_TYPE_ONBOARD_CONTROLLER,
        mavlink.MAV_TYPE_GIMBAL,
        mavlink.MAV_TYPE_ADSB,
        mavlink.MAV_TYPE_CAMERA,
        mavlink.MAV_TYPE_CHARGING_STATION,
        mavlink.MAV_TYPE_FLARM,
        mavlink.MAV_TYPE_ODID,
        mavlink.MAV_TYPE_LOG,
        mavlink.MAV_TYPE_OSD,
    }
)
_FLAVORS = {
    mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA: "ardupilot",
    mavlink.MAV_AUTOPILOT_PX4: "px4",
    mavlink.MAV_AUTOPILOT_GENERIC: "generic",
}
_REPLACED_AFTER_NS = 10_000_000_000
"""A vehicle silent for this long makes room for another system id: the id may have been changed."""


@dataclass(frozen=True)
class Vehicle:
    """The autopilot by its newest HEARTBEAT.

    Args:
        system_id: the vehicle's.
        source: where its bytes come from: an address on UDP, None on a line with one other end.
        autopilot: "ardupilot", "px4", "generic" or "autopilot N" (MAV_AUTOPILOT).
        mode: flight mode by name.
        armed: motors armed.
        heard_ns: arrival of the HEARTBEAT, nanoseconds on the service's clock.
        mav_type: what kind of vehicle it is (MAV_TYPE).
        custom_mode: flight mode as the autopilot numbers it.
    """

    system_id: int
    source: Hashable
    autopilot: str
    mode: str
    armed: bool
    heard_ns: int
    mav_type: int = mavlink.MAV_TYPE_GENERIC
    custom_mode: int = 0


class Hearing(Enum):
    """What a HEARTBEAT was."""

    NO_AUTOPILOT = "no autopilot"
    LEARNT = "learnt"
    KNOWN = "known"
    FOREIGN = "foreign"


class VehicleLearner:
    """Takes the first autopilot that is heard and keeps to it.

    Args:
        only_system_id: the only one to take, or 0 for any.
        timeout_ns: silence after which the same system id may come from another source.
    """

    def __init__(self, only_system_id: int, timeout_ns: int) -> None:
        self._only = only_system_id
        self._timeout_ns = timeout_ns
        self.vehicle: Vehicle | None = None
        self.others: set[int] = set()
        """System ids of other autopilots that were heard."""

    def on_heartbeat(
        self, heartbeat: mavlink.MAVLink_heartbeat_message, source: Hashable, arrival_ns: int
    ) -> Hearing:
        """Take a HEARTBEAT of any sender."""
        if not _is_autopilot(heartbeat):
            return Hearing.NO_AUTOPILOT
        system_id = heartbeat.get_srcSystem()
        if (self._only and system_id != self._only) or not self._may_take(system_id, source, arrival_ns):
            self.others.add(system_id)
            return Hearing.FOREIGN
        known = self.vehicle is not None and (self.vehicle.system_id, self.vehicle.source) == (
            system_id,
            source,
        )
        self.vehicle = Vehicle(
            system_id,
            source,
            _FLAVORS.get(heartbeat.autopilot, f"autopilot {heartbeat.autopilot}"),
            mavutil.mode_string_v10(heartbeat),
            bool(heartbeat.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED),
            arrival_ns,
            heartbeat.type,
            heartbeat.custom_mode,
        )
        return Hearing.KNOWN if known else Hearing.LEARNT

    def is_from_vehicle(self, message: mavlink.MAVLink_message, source: Hashable) -> bool:
        """Whether a message comes from the learnt autopilot itself."""
        vehicle = self.vehicle
        return (
            vehicle is not None
            and message.get_srcSystem() == vehicle.system_id
            and message.get_srcComponent() == _AUTOPILOT_COMPONENT
            and source == vehicle.source
        )

    def _may_take(self, system_id: int, source: Hashable, arrival_ns: int) -> bool:
        vehicle = self.vehicle
        if vehicle is None or (vehicle.system_id, vehicle.source) == (system_id, source):
            return True
        silent_ns = arrival_ns - vehicle.heard_ns
        return silent_ns >= (self._timeout_ns if system_id == vehicle.system_id else _REPLACED_AFTER_NS)


def could_be_autopilot(message: mavlink.MAVLink_message) -> bool:
    """Whether a message is the HEARTBEAT of an autopilot, as far as it says itself."""
    return message.get_type() == "HEARTBEAT" and _is_autopilot(message)


def _is_autopilot(heartbeat: mavlink.MAVLink_heartbeat_message) -> bool:
    return (
        heartbeat.get_srcSystem() != 0
        and heartbeat.get_srcComponent() == _AUTOPILOT_COMPONENT
        and heartbeat.type not in _NO_VEHICLE_TYPES
        and heartbeat.autopilot != mavlink.MAV_AUTOPILOT_INVALID
    )
