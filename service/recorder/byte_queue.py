"""The recorder's queue: bounded in bytes, and what did not fit is counted."""

from __future__ import annotations

import threading
from collections import deque
from typing import Generic, TypeVar

T = TypeVar("T")

_SHARE_OF_LARGE = 0.75
"""Pictures may fill this much; the rest is for small items, which cost little and explain the pictures."""


class ByteQueue(Generic[T]):
    """Items from many threads to one. `put` never waits.

    Args:
        max_bytes: what may wait together.
    """

    def __init__(self, max_bytes: int) -> None:
        self._max_bytes = max_bytes
        self._condition = threading.Condition()
        self._items: deque[tuple[T, int]] = deque()
        self._bytes = 0
        self._closed = False

    def put(self, item: T, size: int, *, large: bool = False) -> bool:
        """Add an item of `size` bytes; False if it does not fit or the queue is closed."""
        limit = self._max_bytes * _SHARE_OF_LARGE if large else self._max_bytes
        with self._condition:
            if self._closed or self._bytes + size > limit:
                return False
            self._items.append((item, size))
            self._bytes += size
            self._condition.notify()
            return True

    def take(self, timeout_s: float) -> T | None:
        """The oldest item, or None if none comes within `timeout_s` or the queue is closed and empty."""
        with self._condition:
            self._condition.wait_for(lambda: self._items or self._closed, timeout_s)
            if not self._items:
                return None
            item, size = self._items.popleft()
            self._bytes -= size
            return item

    def close(self) -> None:
        """Take nothing more in; what is inside can still be taken."""
        with self._condition:
            self._closed = True
            self._condition.notify_all()

    @property
    def finished(self) -> bool:
        """Whether nothing is left and nothing will come."""
        with self._condition:
            return self._closed and not self._items

    @property
    def oldest(self) -> T | None:
        """The item that is taken next, or None."""
        with self._condition:
            return self._items[0][0] if self._items else None
