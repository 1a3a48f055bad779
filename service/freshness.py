"""How old data is, told by the vehicle's own stamps though no clock is shared."""

from __future__ import annotations

from collections import deque
from enum import Enum
from typing import Final

STALE_NS: Final = 1_000_000_000
NO_DATA_NS: Final = 3_000_000_000

_WINDOW_NS = 300_000_000_000
"""The fastest way is remembered over one to two windows: clocks that drift by 50 ppm move 30 ms meanwhile."""

_RESTART_NS = 1_000_000_000
"""Stamps that go back by more belong to another clock: the vehicle's computer was started anew."""

_TWIN_RESTARTS = 3
_TWIN_WINDOW_NS = 10_000_000_000


class Freshness(Enum):
    """What a viewer may make of data of some age."""

    LIVE = "live"
    STALE = "stale"
    NO_DATA = "no data"

    @classmethod
    def of(cls, age_ns: int | None) -> Freshness:
        """Freshness of data that old; None stands for data that never came."""
        if age_ns is None or age_ns > NO_DATA_NS:
            return cls.NO_DATA
        return cls.STALE if age_ns > STALE_NS else cls.LIVE


class ArrivalClock:
    """Maps the stamps of one vehicle to the viewer's clock.

    The fastest sample of the last minutes is taken to have come without delay; whatever comes later than
    that, measured by the vehicle's own stamps, has waited on the way. So data that a slow link delivers
    late is old when it arrives. A constant delay cannot be seen.
    """

    def __init__(self) -> None:
        self._offset_ns: int | None = None
        self._previous_offset_ns: int | None = None
        self._window_ends_ns = 0
        self._newest_captured_ns: int | None = None
        self._restarts: deque[int] = deque(maxlen=_TWIN_RESTARTS)

    def hear(self, captured_ns: int, age_ms: float, arrived_ns: int) -> int:
        """Take the stamps of a sample that just came and tell its age on arrival.

        Args:
            captured_ns: capture time on the vehicle's clock.
            age_ms: age when it was published, by the vehicle's clock, milliseconds.
            arrived_ns: now, on the viewer's clock.

        Returns:
            Time since capture, nanoseconds, never less than `age_ms`.
        """
        newest_ns = self._newest_captured_ns
        if newest_ns is not None and captured_ns < newest_ns - _RESTART_NS:
            self._offset_ns = self._previous_offset_ns = None
            self._restarts.append(arrived_ns)
            newest_ns = None
        self._newest_captured_ns = captured_ns if newest_ns is None else max(newest_ns, captured_ns)
        if arrived_ns >= self._window_ends_ns:
            self._window_ends_ns = arrived_ns + _WINDOW_NS
            self._previous_offset_ns, self._offset_ns = self._offset_ns, None
        offset_ns = arrived_ns - captured_ns - round(age_ms * 1e6)
        self._offset_ns = offset_ns if self._offset_ns is None else min(self._offset_ns, offset_ns)
        return self.age_ns(captured_ns, age_ms, arrived_ns)

    def age_ns(self, captured_ns: int, age_ms: float, arrived_ns: int) -> int:
        """Age on arrival of a sample that may have waited, and so tells nothing of the clock: a picture."""
        published_ns = round(age_ms * 1e6)
        known = [offset for offset in (self._offset_ns, self._previous_offset_ns) if offset is not None]
        if not known:
            return published_ns
        return max(published_ns, arrived_ns - captured_ns - min(known))

    def has_twins(self, now_ns: int) -> bool:
        """Whether stamps jump to and fro, as they do when two vehicles have one name."""
        return len(self._restarts) == _TWIN_RESTARTS and now_ns - self._restarts[0] < _TWIN_WINDOW_NS
