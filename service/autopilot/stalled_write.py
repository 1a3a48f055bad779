"""Bytes that a stream has not taken yet."""

from __future__ import annotations

from collections.abc import Callable

from service.clock import Clock

_LOST_AFTER_NS = 3_000_000_000
"""A line that takes no byte for this long is lost."""


class StalledWrite:
    """Keeps the rest of a write that the line did not take, so that frames stay whole.

    Args:
        write: writes without blocking and returns how many bytes went; raises BlockingIOError if none can.
        clock: tells how long the line has taken nothing.
    """

    def __init__(self, write: Callable[[bytes], int], clock: Clock) -> None:
        self._write = write
        self._clock = clock
        self._rest = bytearray()
        self._stalled_since_ns: int | None = None

    def __len__(self) -> int:
        return len(self._rest)

    def push(self, data: bytes = b"") -> None:
        """Write as much as the line takes of what was kept and of `data`.

        Raises:
            TimeoutError: nothing was taken for 3 s.
            OSError: the line is lost.
        """
        self._rest += data
        now_ns = self._clock.now_ns()
        while self._rest:
            try:
                written = self._write(bytes(self._rest))
            except BlockingIOError:
                break
            del self._rest[:written]
            self._stalled_since_ns = None
        if not self._rest:
            self._stalled_since_ns = None
        elif self._stalled_since_ns is None:
            self._stalled_since_ns = now_ns
        elif now_ns - self._stalled_since_ns > _LOST_AFTER_NS:
            raise TimeoutError(f"the other end has taken nothing for {_LOST_AFTER_NS / 1e9:g} s")
