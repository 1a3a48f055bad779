"""How long a message is under way to the autopilot, learnt from TIMESYNC."""

from __future__ import annotations

from collections import deque
from statistics import median

from service.autopilot.byte_budget import OBSTACLE_BYTES
from service.autopilot.endpoint import SerialEndpoint, parse_endpoint

_KEPT = 9
_LONGEST_NS = 100_000_000
"""A longer way than this is not made good: a radio that bad carries no obstacles in time."""

_BITS_PER_BYTE = 10


class TransportDelay:
    """Half of the usual round trip, and on a serial line the time that the message itself takes.

    Args:
        endpoint: of the line.
    """

    def __init__(self, endpoint: str) -> None:
        line = parse_endpoint(endpoint) if endpoint.startswith("serial:") else None
        bytes_per_s = line.baud / _BITS_PER_BYTE if isinstance(line, SerialEndpoint) else 0.0
        self._message_ns = round(OBSTACLE_BYTES / bytes_per_s * 1e9) if bytes_per_s else 0
        self._trips_ns: deque[int] = deque(maxlen=_KEPT)

    def on_round_trip(self, sent_ns: int, received_ns: int) -> None:
        """Take a request and its answer, both on the service's clock."""
        self._trips_ns.append(max(0, received_ns - sent_ns))

    @property
    def estimate_ns(self) -> int:
        """From leaving to the autopilot, nanoseconds; before the first answer the line's part alone."""
        trip_ns = median(self._trips_ns) if self._trips_ns else 0
        return min(round(trip_ns / 2) + self._message_ns, _LONGEST_NS)
