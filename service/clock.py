"""Time comes in from here, so that a recorded flight and a test can bring their own."""

from __future__ import annotations

import time
from typing import Protocol


class Clock(Protocol):
    """A clock that only goes forward."""

    def now_ns(self) -> int:
        """Nanoseconds since an arbitrary start."""


class MonotonicClock:
    """The live clock: the operating system's monotonic one, untouched by NTP steps."""

    def now_ns(self) -> int:
        return time.monotonic_ns()


class ManualClock:
    """A clock that stands still until it is told: for tests and replay."""

    def __init__(self, start_ns: int = 0) -> None:
        self._now_ns = start_ns

    def now_ns(self) -> int:
        return self._now_ns

    def set_ns(self, now_ns: int) -> None:
        """Move to `now_ns`. Raises ValueError if that is in the past."""
        if now_ns < self._now_ns:
            raise ValueError(f"clock cannot go back from {self._now_ns} to {now_ns} ns")
        self._now_ns = now_ns

    def advance_s(self, seconds: float) -> None:
        """Move forward by `seconds`."""
        self.set_ns(self._now_ns + round(seconds * 1e9))
