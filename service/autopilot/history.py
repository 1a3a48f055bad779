"""The last seconds of one kind of message, to be asked for a moment in between."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from typing import Generic, TypeVar

Value = TypeVar("Value")


class History(Generic[Value]):
    """Values by time, oldest dropped. Times are the autopilot's, nanoseconds since boot.

    Args:
        capacity: values that are kept.
    """

    def __init__(self, capacity: int = 256) -> None:
        self._capacity = capacity
        self._times_ns: list[int] = []
        self._values: list[Value] = []

    def add(self, boot_ns: int, value: Value) -> None:
        """Add a value where its time belongs; a second one for the same time is dropped."""
        i = bisect_left(self._times_ns, boot_ns)
        if i < len(self._times_ns) and self._times_ns[i] == boot_ns:
            return
        self._times_ns.insert(i, boot_ns)
        self._values.insert(i, value)
        if len(self._times_ns) >= 2 * self._capacity:
            del self._times_ns[: -self._capacity]
            del self._values[: -self._capacity]

    def clear(self) -> None:
        """Forget everything."""
        self._times_ns.clear()
        self._values.clear()

    def around(self, boot_ns: int) -> tuple[tuple[int, Value] | None, tuple[int, Value] | None]:
        """The (time, value) at or before `boot_ns` and the one after it; None where there is none."""
        i = bisect_right(self._times_ns, boot_ns)
        before = (self._times_ns[i - 1], self._values[i - 1]) if i else None
        after = (self._times_ns[i], self._values[i]) if i < len(self._times_ns) else None
        return before, after

    @property
    def newest_ns(self) -> int | None:
        """Time of the newest value."""
        return self._times_ns[-1] if self._times_ns else None
