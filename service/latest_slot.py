"""The slot between two stages: it holds the newest value and counts what it dropped."""

from __future__ import annotations

import threading
from typing import Generic, TypeVar

T = TypeVar("T")


class LatestSlot(Generic[T]):
    """One value from one thread to another; a slow taker loses old values, nothing ever queues.

    `put` never waits. Each value is taken at most once.
    """

    def __init__(self) -> None:
        self._condition = threading.Condition()
        self._value: T | None = None
        self._full = False
        self._closed = False
        self._put_count = 0
        self._dropped_count = 0

    def put(self, value: T) -> None:
        """Make `value` the newest; the one that nobody took is dropped. After `close` nothing is kept."""
        with self._condition:
            if self._closed:
                return
            self._put_count += 1
            if self._full:
                self._dropped_count += 1
            self._value, self._full = value, True
            self._condition.notify()

    def take(self, timeout_s: float | None = 0.0) -> T | None:
        """The newest value, or None if none came within `timeout_s` (None: wait for ever) or on `close`."""
        with self._condition:
            self._condition.wait_for(lambda: self._full or self._closed, timeout_s)
            if not self._full:
                return None
            value, self._value, self._full = self._value, None, False
            return value

    def close(self) -> None:
        """Wake the taker and take nothing more; a value inside can still be taken."""
        with self._condition:
            self._closed = True
            self._condition.notify_all()

    @property
    def closed(self) -> bool:
        """Whether `close` was called."""
        return self._closed

    @property
    def put_count(self) -> int:
        """Values that came in."""
        return self._put_count

    @property
    def dropped_count(self) -> int:
        """Values that a newer one replaced before anyone took them."""
        return self._dropped_count
