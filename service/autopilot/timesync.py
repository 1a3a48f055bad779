"""TIMESYNC, both ways: our requests and the autopilot's."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

from pymavlink.dialects.v20 import ardupilotmega as mavlink

_KEPT_REQUESTS = 16
_QUICK_REQUESTS = 5
_QUICK_PERIOD_NS = 200_000_000
"""The first requests follow each other quickly: the clocks are bound within a second."""


@dataclass(frozen=True)
class RoundTrip:
    """A request of ours and its answer.

    Args:
        sent_ns, received_ns: on the service's clock.
        boot_ns: the autopilot's clock when it answered, nanoseconds since boot.
    """

    sent_ns: int
    boot_ns: int
    received_ns: int


class TimeSync:
    """Makes requests, recognises the answers to them and answers the autopilot's.

    Args:
        period_ns: time between requests once the first are through.
    """

    def __init__(self, period_ns: int) -> None:
        self._period_ns = period_ns
        self._outstanding: deque[int] = deque(maxlen=_KEPT_REQUESTS)
        self._sent = 0
        self._next_ns = 0

    def restart(self) -> None:
        """Begin again with quick requests; answers to earlier ones no longer count."""
        self._outstanding.clear()
        self._sent = 0
        self._next_ns = 0

    def request(self, now_ns: int) -> mavlink.MAVLink_timesync_message | None:
        """A request, if one is due."""
        if now_ns < self._next_ns:
            return None
        self._sent += 1
        self._next_ns = now_ns + (_QUICK_PERIOD_NS if self._sent < _QUICK_REQUESTS else self._period_ns)
        self._outstanding.append(now_ns)
        return mavlink.MAVLink_timesync_message(0, now_ns)

    @staticmethod
    def answer(
        message: mavlink.MAVLink_timesync_message, now_ns: int
    ) -> mavlink.MAVLink_timesync_message | None:
        """Our answer to the autopilot's request, or None if the message is no request."""
        if message.tc1 != 0:
            return None
        return mavlink.MAVLink_timesync_message(now_ns, message.ts1)

    def round_trip(self, message: mavlink.MAVLink_timesync_message, arrival_ns: int) -> RoundTrip | None:
        """What an answer tells, or None if it answers no request of ours (others ask too)."""
        if message.tc1 <= 0 or message.ts1 not in self._outstanding or message.ts1 > arrival_ns:
            return None
        self._outstanding.remove(message.ts1)
        return RoundTrip(message.ts1, message.tc1, arrival_ns)
