"""What the service asks of the autopilot: streams, time, version, and once in need to stop."""

from __future__ import annotations

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.autopilot.hold_request import HoldRequest
from service.autopilot.profile_choice import ProfileChoice
from service.autopilot.streams import StreamRequests, WantedStream, wanted_streams
from service.autopilot.timesync import RoundTrip, TimeSync
from service.autopilot.vehicle import Vehicle
from service.settings.autopilot import AutopilotSettings


class Requests:
    """Decides when each question is asked, and asks again what a reboot or a silence has lost.

    Args:
        settings: the `[autopilot]` section.
        choice: asks for the version as long as that decides the layout.
    """

    def __init__(self, settings: AutopilotSettings, choice: ProfileChoice) -> None:
        self._streams = StreamRequests(wanted_streams(settings))
        self._timesync = TimeSync(round(1e9 / settings.timesync_rate_hz))
        self._choice = choice
        self.hold: HoldRequest | None = None
        """The last request to stop and stay; None if there was none."""

    def restart(self) -> None:
        """Ask for everything again, but not to stop: that was asked for another moment."""
        if self.hold is not None:
            self.hold.give_up()
        self._streams.restart()
        self._timesync.restart()
        self._choice.restart()

    def restart_time(self) -> None:
        """Bind the clocks again: one has stepped."""
        self._timesync.restart()

    def ask_to_hold(self, vehicle: Vehicle) -> str:
        """Ask to stop and stay; returns the mode that is asked for, empty if the vehicle has none."""
        self.hold = HoldRequest(vehicle)
        return self.hold.mode

    def on_mode(self, vehicle: Vehicle) -> None:
        """A HEARTBEAT has told the mode."""
        if self.hold is not None:
            self.hold.on_mode(vehicle.custom_mode)

    def due(self, system_id: int, now_ns: int) -> list[mavlink.MAVLink_message]:
        """What to ask the autopilot of `system_id` now."""
        asked: list[mavlink.MAVLink_message] = [
            stream.request(system_id) for stream in self._streams.due(now_ns)
        ]
        hold = None if self.hold is None else self.hold.due(now_ns)
        for request in (hold, self._timesync.request(now_ns), self._choice.request(system_id, now_ns)):
            if request is not None:
                asked.append(request)
        return asked

    def on_message(self, message: mavlink.MAVLink_message, arrival_ns: int) -> None:
        """Take a message of the autopilot: one of a stream, or an answer."""
        self._streams.on_message(message.get_type(), arrival_ns)
        if self.hold is not None and message.get_type() == "COMMAND_ACK":
            self.hold.on_ack(message)

    def on_timesync(
        self, message: mavlink.MAVLink_timesync_message, arrival_ns: int
    ) -> mavlink.MAVLink_timesync_message | RoundTrip | None:
        """Our answer to a request, or what an answer to ours tells; None for answers to others."""
        return self._timesync.answer(message, arrival_ns) or self._timesync.round_trip(message, arrival_ns)

    def refused(self) -> list[WantedStream]:
        """Streams that were asked for several times and still do not come."""
        return self._streams.refused()

    def rates_hz(self, now_ns: int) -> dict[str, float]:
        """Messages a second by name, over the last two seconds."""
        return self._streams.rates_hz(now_ns)
