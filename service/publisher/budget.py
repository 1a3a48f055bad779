"""How many bytes of pictures a second the link takes: found from what the ground reports as received.

Slow growth and quick retreat on delay, as congestion controls do it that must leave room for others (LEDBAT,
RFC 6817); quick growth until pictures have waited for the first time (slow start, RFC 5681). A queue is one
that stands: the shortest of several delays tells it from a busy processor (CoDel, RFC 8289). Below the rate
that was too much last, growth waits for a while (CUBIC, RFC 9438). The delay is measured on the vehicle's
clock alone.
"""

from __future__ import annotations

from collections import OrderedDict, deque
from typing import Final

from service.publisher.received import ReceivedReport

START_BYTES_PER_S: Final = 60_000.0
"""Until the first report: half of a link of 1 Mbit/s. What a faster one takes is found within seconds."""

_MIN_BYTES_PER_S: Final = 4_000.0
_UNREPORTED_NS: Final = 2_000_000_000
"""Viewers that have not reported by then never will: the configured limit counts for them."""

_LOST_NS: Final = 1_500_000_000
"""So long without a report while pictures are sent: they do not arrive."""

_HIGH_NS: Final = 80_000_000
"""Waiting in queues, beyond the shortest delay seen, at which the budget shrinks. Scans share the queue and
are to be 150 ms late at most."""

_LOW_NS: Final = 40_000_000
"""Waiting below which the budget grows."""

_FIRST_GROWTH: Final = 0.2
"""With each report, before pictures have ever waited."""

_FIRST_PROOF: Final = 4.0
"""The budget grows so fast only up to this many times what has arrived in the time of a report (few and small
pictures prove nothing about more and larger ones, RFC 7661), or up to the rate of the newest picture, which
cannot have come faster than the slowest part of the link takes bytes."""

_GROWTH: Final = 0.06
"""With each report after that."""

_CAREFUL_GROWTH: Final = 0.004
_PROBING: Final = 0.02
_CAREFUL_NS: Final = 8_000_000_000
"""Growth near the rate that was too much last, for how long, and growth there after that."""

_NEAR: Final = 0.9
_FAR: Final = 3.0
"""Between these parts of the rate that was too much last it is near."""

_RETREAT: Final = 0.85
_DEEPEST: Final = 0.7
"""Least of the budget that one retreat believes to have arrived: one report counts few pictures."""

_STANDING: Final = 3
"""Reports in a row that must tell of waiting; of long waiting (twice `_HIGH_NS`) two do."""

_WINDOW_S: Final = 0.5
"""What may be on its way, in seconds of the budget: bounds the queue of a link that gets slower."""

_BASE_WINDOW_NS: Final = 20_000_000_000
_MAX_SENT = 256
_MAX_STATIONS = 8


class PictureBudget:
    """Bytes of pictures a second, between 4 kB and the configured limit.

    Args:
        limit_bytes_per_s: what the configuration allows.
    """

    def __init__(self, limit_bytes_per_s: float) -> None:
        self._limit = limit_bytes_per_s
        self.bytes_per_s = min(START_BYTES_PER_S, limit_bytes_per_s)
        """What may be sent now."""
        self.delay_ms: float | None = None
        """From publishing to the report of it, by the newest report."""
        self._too_much: float | None = None
        self._has_waited = False
        self._sent: OrderedDict[tuple[str, int], tuple[int, int]] = OrderedDict()
        self._first_sent_ns: int | None = None
        self._last_sent_ns: int | None = None
        self._last_report_ns: int | None = None
        self._shrunk_ns: int | None = None
        self._delays: deque[tuple[int, int]] = deque()
        self._flying: deque[tuple[int, int]] = deque()
        self._flying_bytes = 0
        self._stations: OrderedDict[str, deque[int]] = OrderedDict()

    @property
    def has_room(self) -> bool:
        """Whether another picture may be on its way."""
        return self._last_report_ns is None or self._flying_bytes <= _WINDOW_S * self.bytes_per_s

    def sent(self, topic: str, index: int, size_bytes: int, now_ns: int) -> None:
        """A picture was handed to the link."""
        self._flying.append((now_ns, size_bytes))
        self._flying_bytes += size_bytes
        while len(self._flying) > _MAX_SENT:
            self._flying_bytes -= self._flying.popleft()[1]
        self._sent[topic, index] = now_ns, size_bytes
        while len(self._sent) > _MAX_SENT:
            self._sent.popitem(last=False)
        self._last_sent_ns = now_ns
        if self._first_sent_ns is None:
            self._first_sent_ns = now_ns

    def hear(self, report: ReceivedReport, now_ns: int, *, wants_more: bool = True) -> None:
        """A ground station says what has arrived. Reports that fit nothing that was sent change nothing.

        Args:
            report: from the network.
            now_ns: when it came, on the vehicle's clock.
            wants_more: pictures are smaller or fewer than they should be.
        """
        sent = self._sent.get((report.topic, report.index))
        if sent is None:
            return
        sent_ns, size_bytes = sent
        waits = self._stations.setdefault(report.station, deque(maxlen=_STANDING))
        self._stations.move_to_end(report.station)
        while len(self._stations) > _MAX_STATIONS:
            self._stations.popitem(last=False)
        self._last_report_ns = now_ns
        while self._flying and self._flying[0][0] <= sent_ns:
            self._flying_bytes -= self._flying.popleft()[1]
        arrived = 1e3 * report.size_bytes / max(report.interval_ms, 100.0)
        delay_ns = max(0, now_ns - sent_ns - round(report.age_ms * 1e6))
        self.delay_ms = delay_ns / 1e6
        waits.append(delay_ns - self._base_ns(delay_ns, now_ns))
        self._has_waited |= len(waits) == _STANDING and min(waits) >= _LOW_NS
        if _stands(waits):
            waits.clear()
            self._too_much = min(self.bytes_per_s, max(arrived, _DEEPEST * self.bytes_per_s))
            self._shrunk_ns = now_ns
            self._set(_RETREAT * self._too_much)
        elif waits[-1] < _LOW_NS and wants_more:
            # Each of several stations reports: together they must not grow faster than one.
            proven = max(_FIRST_PROOF * arrived, 1e9 * size_bytes / max(delay_ns, 1_000_000))
            self._set(self.bytes_per_s * (1 + self._growth(proven, now_ns) / len(self._stations)))

    def _growth(self, proven_bytes_per_s: float, now_ns: int) -> float:
        if self._too_much is None or self._shrunk_ns is None:
            proven = proven_bytes_per_s / self.bytes_per_s - 1
            return _GROWTH if self._has_waited else min(max(proven, _GROWTH), _FIRST_GROWTH)
        if not _NEAR * self._too_much < self.bytes_per_s < _FAR * self._too_much:
            return _GROWTH
        is_early = now_ns - self._shrunk_ns <= _CAREFUL_NS
        return _CAREFUL_GROWTH if is_early else _PROBING

    def tick(self, now_ns: int) -> None:
        """Notice reports that do not come."""
        if self._last_report_ns is None:
            if self._first_sent_ns is not None and now_ns - self._first_sent_ns > _UNREPORTED_NS:
                self._set(self._limit)
            return
        if self._last_sent_ns is None or self._last_sent_ns <= self._last_report_ns:
            return
        if now_ns - max(self._last_report_ns, self._shrunk_ns or 0) > _LOST_NS:
            self._shrunk_ns = now_ns
            self._flying.clear()
            self._flying_bytes = 0
            self._set(self.bytes_per_s / 2)

    def _base_ns(self, delay_ns: int, now_ns: int) -> int:
        """The shortest delay of the last 20 s: what the link takes when nothing waits."""
        while self._delays and now_ns - self._delays[0][0] > _BASE_WINDOW_NS:
            self._delays.popleft()
        # A queue of falling minima: its front is the minimum of the window.
        while self._delays and self._delays[-1][1] >= delay_ns:
            self._delays.pop()
        self._delays.append((now_ns, delay_ns))
        return self._delays[0][1]

    def _set(self, bytes_per_s: float) -> None:
        self.bytes_per_s = min(max(bytes_per_s, min(_MIN_BYTES_PER_S, self._limit)), self._limit)


def _stands(waits: deque[int]) -> bool:
    """Whether a queue stands, by what the last reports say of waiting, newest last."""
    newest = list(waits)
    return (len(newest) >= _STANDING and min(newest) > _HIGH_NS) or (
        len(newest) >= 2 and min(newest[-2:]) > 2 * _HIGH_NS
    )
