"""Asking the autopilot once to stop and stay: BRAKE, LOITER, HOLD or Hold, whatever the vehicle has."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.autopilot.presence import COMPONENT_ID
from service.autopilot.vehicle import Vehicle

_MODE_TOLD_NS = 200_000_000
"""The autopilot is given so long to tell its mode first, which it does once a second by itself: ArduPilot
opens the way 0.3 s after a hold is asked for at the earliest."""

_ANSWER_NS = 300_000_000
_MOST_TRIES = 3
"""A request without an answer is taken for lost and sent again, twice."""

_BRAKE, _LOITER, _ROVER_HOLD = 17, 5, 4
"""custom_mode of ArduCopter's BRAKE and LOITER, and of ArduRover's HOLD."""

_PX4_AUTO, _PX4_AUTO_LOITER = 4, 3
"""Main and sub mode of PX4's Hold."""

_COPTERS = frozenset(
    {
        mavlink.MAV_TYPE_QUADROTOR,
        mavlink.MAV_TYPE_COAXIAL,
        mavlink.MAV_TYPE_HELICOPTER,
        mavlink.MAV_TYPE_HEXAROTOR,
        mavlink.MAV_TYPE_OCTOROTOR,
        mavlink.MAV_TYPE_TRICOPTER,
        mavlink.MAV_TYPE_DODECAROTOR,
        mavlink.MAV_TYPE_DECAROTOR,
    }
)
_ROVERS = frozenset({mavlink.MAV_TYPE_GROUND_ROVER, mavlink.MAV_TYPE_SURFACE_BOAT})


class HoldOutcome(StrEnum):
    """What has become of a request."""

    WANTED = "wanted"
    """The autopilot is asked for its mode."""
    ASKED = "asked"
    GRANTED = "granted"
    REFUSED = "refused"
    UNANSWERED = "unanswered"
    OVERRULED = "overruled"
    """Somebody else has chosen another mode."""
    IMPOSSIBLE = "impossible"
    """No mode of this vehicle is known to stop it."""


_OPEN = frozenset({HoldOutcome.WANTED, HoldOutcome.ASKED})


@dataclass(frozen=True)
class HoldMode:
    """A mode in which a vehicle stops and stays.

    Args:
        name: as pilots know it.
        custom_mode: as in HEARTBEAT.
        main, sub: as in MAV_CMD_DO_SET_MODE.
    """

    name: str
    custom_mode: int
    main: int
    sub: int = 0


def hold_modes(vehicle: Vehicle) -> list[HoldMode]:
    """Modes that stop this vehicle, the best first; the one that it flies in is none.

    ArduCopter's BRAKE stops whatever the sticks say, LOITER where they are centred; PX4's Hold does both.
    """
    modes: list[HoldMode] = []
    if vehicle.autopilot == "px4":
        word = _PX4_AUTO << 16 | _PX4_AUTO_LOITER << 24
        modes = [HoldMode("Hold", word, _PX4_AUTO, _PX4_AUTO_LOITER)]
    elif vehicle.autopilot == "ardupilot" and vehicle.mav_type in _COPTERS:
        modes = [HoldMode("BRAKE", _BRAKE, _BRAKE), HoldMode("LOITER", _LOITER, _LOITER)]
    elif vehicle.autopilot == "ardupilot" and vehicle.mav_type in _ROVERS:
        modes = [HoldMode("HOLD", _ROVER_HOLD, _ROVER_HOLD)]
    return [mode for mode in modes if mode.custom_mode != vehicle.custom_mode]


class HoldRequest:
    """One request, from the first command to its end. Only a command without an answer is sent again.

    First the autopilot is asked for a HEARTBEAT: the pilot may have chosen another mode since the last one.

    Args:
        vehicle: whom it is for.
    """

    def __init__(self, vehicle: Vehicle) -> None:
        self._system_id = vehicle.system_id
        self._flown_in = vehicle.custom_mode
        self._modes = hold_modes(vehicle)
        self._tries = 0
        self._due_ns = 0
        self._is_mode_asked = self._is_mode_told = False
        self.outcome = HoldOutcome.WANTED if self._modes else HoldOutcome.IMPOSSIBLE
        """What has become of it."""

    @property
    def mode(self) -> str:
        """The mode that is asked for; empty where there is none."""
        return self._modes[0].name if self._modes else ""

    def due(self, now_ns: int) -> mavlink.MAVLink_command_long_message | None:
        """The command, if it is time to send it."""
        if self.outcome not in _OPEN:
            return None
        if not self._is_mode_asked:
            self._is_mode_asked, self._due_ns = True, now_ns + _MODE_TOLD_NS
            return self._command(mavlink.MAV_CMD_REQUEST_MESSAGE, 0, float(mavlink.MAVLINK_MSG_ID_HEARTBEAT))
        if now_ns < self._due_ns and (self._tries or not self._is_mode_told):
            return None
        if self._tries >= _MOST_TRIES:
            self.outcome = HoldOutcome.UNANSWERED
            return None
        self._due_ns = now_ns + _ANSWER_NS
        wanted = self._modes[0]
        command = self._command(
            mavlink.MAV_CMD_DO_SET_MODE,
            self._tries,
            float(mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED),
            float(wanted.main),
            float(wanted.sub),
        )
        self._tries += 1
        self.outcome = HoldOutcome.ASKED
        return command

    def _command(
        self, command: int, confirmation: int, *values: float
    ) -> mavlink.MAVLink_command_long_message:
        parameters = [*values, *[0.0] * (7 - len(values))]
        return mavlink.MAVLink_command_long_message(
            self._system_id, mavlink.MAV_COMP_ID_AUTOPILOT1, command, confirmation, *parameters
        )

    def give_up(self) -> None:
        """The line was silent: what was asked then must not reach a pilot who flies by hand by now."""
        if self.outcome in _OPEN:
            self.outcome = HoldOutcome.UNANSWERED

    def on_ack(self, ack: mavlink.MAVLink_command_ack_message) -> None:
        """Take a COMMAND_ACK; those to other commands and to other senders are not looked at."""
        if self.outcome is not HoldOutcome.ASKED or ack.command != mavlink.MAV_CMD_DO_SET_MODE:
            return
        if not self._tries or ack.target_component not in (0, COMPONENT_ID):
            return
        if ack.result == mavlink.MAV_RESULT_ACCEPTED:
            self.outcome = HoldOutcome.GRANTED
            self._flown_in = self._modes[0].custom_mode
        elif ack.result != mavlink.MAV_RESULT_IN_PROGRESS:
            self._refused()

    def _refused(self) -> None:
        """Go on to the next mode, if there is one."""
        if len(self._modes) == 1:
            self.outcome = HoldOutcome.REFUSED
            return
        del self._modes[0]
        self._tries, self._due_ns = 0, 0

    def on_mode(self, custom_mode: int) -> None:
        """The mode in a HEARTBEAT: the wanted one grants, a third one is somebody else's wish."""
        if not self._modes:
            return
        self._is_mode_told = self._is_mode_asked
        if custom_mode == self._modes[0].custom_mode:
            self.outcome, self._flown_in = HoldOutcome.GRANTED, custom_mode
        elif custom_mode != self._flown_in:
            self.outcome = HoldOutcome.OVERRULED
