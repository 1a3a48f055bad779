"""Messages at the rates that the service needs: asked for, checked by what arrives, asked again."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.autopilot.rate_meter import RateMeter
from service.settings.autopilot import AutopilotSettings

_ENOUGH = 0.7
"""Part of the wanted rate that is enough: ArduPilot quantises (30 Hz comes as 28.7), links lose some."""

_FIRST_CHECK_NS = 1_500_000_000
_LAST_CHECK_NS = 5_000_000_000
"""Time that a request is given before the rate is judged; it grows with each try that failed."""

_COMPLAIN_AFTER = 4
"""Tries without success after which the stream counts as refused."""


@dataclass(frozen=True)
class WantedStream:
    """A message and its rate.

    Args:
        message: name, as in the MAVLink definitions.
        message_id: its number.
        rate_hz: messages wanted a second.
    """

    message: str
    message_id: int
    rate_hz: float

    def request(self, system_id: int) -> mavlink.MAVLink_command_long_message:
        """SET_MESSAGE_INTERVAL for the autopilot of the vehicle `system_id`."""
        return mavlink.MAVLink_command_long_message(
            system_id,
            mavlink.MAV_COMP_ID_AUTOPILOT1,
            mavlink.MAV_CMD_SET_MESSAGE_INTERVAL,
            0,
            float(self.message_id),
            round(1e6 / self.rate_hz),
            *[0.0] * 5,
        )


def wanted_streams(settings: AutopilotSettings) -> tuple[WantedStream, ...]:
    """The messages that the service lives on."""
    return (
        WantedStream("ATTITUDE", mavlink.MAVLINK_MSG_ID_ATTITUDE, settings.attitude_rate_hz),
        WantedStream(
            "LOCAL_POSITION_NED", mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED, settings.position_rate_hz
        ),
        WantedStream("DISTANCE_SENSOR", mavlink.MAVLINK_MSG_ID_DISTANCE_SENSOR, settings.rangefinder_rate_hz),
    )


@dataclass
class _Progress:
    tries: int = 0
    asked_at_ns: int | None = None
    next_check_ns: int = 0
    meter: RateMeter = field(default_factory=RateMeter)


class StreamRequests:
    """Decides when SET_MESSAGE_INTERVAL is sent.

    ArduPilot loses all requests at a reboot, and acknowledges requests during its start-up without
    honouring them (measured): so only the rate that arrives is believed, never the acknowledgement.
    """

    def __init__(self, wanted: Iterable[WantedStream]) -> None:
        self._wanted = tuple(wanted)
        self._progress = {stream.message: _Progress() for stream in self._wanted}

    def restart(self) -> None:
        """Ask for everything anew at the next `due`: the autopilot is new, back, or has rebooted."""
        for progress in self._progress.values():
            progress.tries, progress.asked_at_ns, progress.next_check_ns = 0, None, 0

    def on_message(self, message: str, arrival_ns: int) -> None:
        """Count a message that arrived."""
        if message in self._progress:
            self._progress[message].meter.add(arrival_ns)

    def due(self, now_ns: int) -> list[WantedStream]:
        """Streams to ask for now."""
        asked = []
        for stream in self._wanted:
            progress = self._progress[stream.message]
            if progress.asked_at_ns is not None:
                if now_ns < progress.next_check_ns:
                    continue
                rate_hz = progress.meter.per_second(now_ns, progress.asked_at_ns)
                if rate_hz >= _ENOUGH * stream.rate_hz:
                    progress.tries, progress.next_check_ns = 0, now_ns + _FIRST_CHECK_NS
                    continue
            progress.asked_at_ns = now_ns
            progress.next_check_ns = now_ns + min(_FIRST_CHECK_NS * 2**progress.tries, _LAST_CHECK_NS)
            progress.tries = min(progress.tries + 1, _COMPLAIN_AFTER)
            asked.append(stream)
        return asked

    def refused(self) -> list[WantedStream]:
        """Streams that were asked for several times and still do not come."""
        return [stream for stream in self._wanted if self._progress[stream.message].tries >= _COMPLAIN_AFTER]

    def rates_hz(self, now_ns: int) -> dict[str, float]:
        """Messages a second by name, over the last two seconds."""
        return {name: progress.meter.per_second(now_ns) for name, progress in self._progress.items()}
