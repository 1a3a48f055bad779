"""The pace of sources that have all their pictures at once."""

from __future__ import annotations


class Pace:
    """When the pictures of a file are due, so that it plays as fast as it was taken.

    Args:
        fps: pictures per second.
        start_ns: when the first one is due.
    """

    def __init__(self, fps: float, start_ns: int) -> None:
        self._period_ns = 1e9 / fps
        self._start_ns = start_ns
        self._count = 0

    @property
    def due_ns(self) -> int:
        """When the next picture is due."""
        return self._start_ns + round(self._count * self._period_ns)

    def wait_s(self, now_ns: int) -> float:
        """Seconds until the next picture is due; 0 if it is late."""
        return max(0.0, (self.due_ns - now_ns) / 1e9)

    def step(self) -> int:
        """Move on by one picture; returns when it was due."""
        due_ns = self.due_ns
        self._count += 1
        return due_ns

    def late_pictures(self, now_ns: int) -> int:
        """Whole pictures that should have gone by `now_ns` besides the one that is due."""
        return max(0, int((now_ns - self.due_ns) // self._period_ns))
