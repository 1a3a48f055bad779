"""The autopilot link on the record's clock: the same session that live links run through."""

from __future__ import annotations

from collections.abc import Sequence

from service.autopilot.framing import FrameReader
from service.autopilot.session import LinkSession
from service.replay.footage import Packets
from service.settings.autopilot import AutopilotSettings
from service.telemetry import Telemetry


class ReplayedLink:
    """Hears a recorded line up to a moment. One thread.

    What the service itself said is not sent again; its recorded TIMESYNC requests are asked again at their
    own moments, so that the recorded answers bind the clocks as they did in flight.

    Args:
        settings: the `[autopilot]` section.
        packets: the line's bytes in the order of their times.
    """

    def __init__(self, settings: AutopilotSettings, packets: Sequence[Packets]) -> None:
        unsigned = settings.model_copy(update={"signing_key_file": None})
        self._session = LinkSession(unsigned)
        self._packets = packets
        self._next = 0
        self._now_ns = packets[0].at_ns if packets else 0
        self._requests = FrameReader()
        self._session.line_opened(self._now_ns)

    def hear_until(self, now_ns: int) -> None:
        """Let the recorded time become `now_ns`; it never goes back."""
        self._now_ns = max(self._now_ns, now_ns)
        while self._next < len(self._packets) and self._packets[self._next].at_ns <= self._now_ns:
            packets = self._packets[self._next]
            self._next += 1
            if packets.outgoing:
                self._ask_again(packets)
            else:
                self._session.receive(packets.data, packets.at_ns, packets.sender)
        self._session.take_notices()

    def telemetry_at(self, captured_ns: int) -> Telemetry:
        """What the vehicle did at `captured_ns`, as far as it is known by now."""
        return self._session.telemetry_at(captured_ns, self._now_ns)

    def _ask_again(self, packets: Packets) -> None:
        for message in self._requests.read(packets.data):
            if message.get_type() == "TIMESYNC" and message.tc1 == 0 and 0 <= message.ts1 <= packets.at_ns:
                self._session.tick(message.ts1)
                self._session.take_output(message.ts1)

    @property
    def reboots(self) -> int:
        """Reboots of the autopilot that were seen so far."""
        return self._session.status(self._now_ns).reboots
