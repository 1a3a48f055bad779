"""The service's own HEARTBEAT."""

from __future__ import annotations

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.autopilot.service_state import ServiceState

COMPONENT_ID = mavlink.MAV_COMP_ID_OBSTACLE_AVOIDANCE
"""196, as autopilots and ground stations expect of a source of obstacles."""

_PERIOD_NS = 1_000_000_000
_LEAST_GAP_NS = 200_000_000
"""A change of state is told at once, but no faster after the last one than this."""


class Presence:
    """Decides when a HEARTBEAT is sent: every second, and at once when the state changes."""

    def __init__(self) -> None:
        self._state = ServiceState.BOOT
        self._told: ServiceState | None = None
        self._beat_ns: int | None = None
        self._changed_ns: int | None = None

    def set_state(self, state: ServiceState) -> None:
        """Tell this state from now on."""
        self._state = state

    def restart(self) -> None:
        """Beat at once: the link is new."""
        self._beat_ns = None

    def heartbeat(self, now_ns: int) -> mavlink.MAVLink_heartbeat_message | None:
        """A heartbeat, if one is due."""
        if self._beat_ns is None:
            self._beat_ns = now_ns
        elif now_ns - self._beat_ns >= _PERIOD_NS:
            late_ns = now_ns - self._beat_ns - _PERIOD_NS
            self._beat_ns = now_ns if late_ns >= _PERIOD_NS else self._beat_ns + _PERIOD_NS
        elif self._state == self._told or not self._may_change(now_ns):
            return None
        if self._state != self._told:
            self._told, self._changed_ns = self._state, now_ns
        return mavlink.MAVLink_heartbeat_message(
            mavlink.MAV_TYPE_ONBOARD_CONTROLLER,
            mavlink.MAV_AUTOPILOT_INVALID,
            0,
            0,
            int(self._state),
            3,  # mavlink_version, fixed by the protocol
        )

    def _may_change(self, now_ns: int) -> bool:
        return self._changed_ns is None or now_ns - self._changed_ns >= _LEAST_GAP_NS
