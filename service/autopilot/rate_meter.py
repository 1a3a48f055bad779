"""How often things happen, counted in a sliding window."""

from __future__ import annotations

from collections import deque


class RateMeter:
    """Events, or bytes, per second.

    Args:
        window_s: how far back it looks.
    """

    def __init__(self, window_s: float = 2.0) -> None:
        self._window_ns = round(window_s * 1e9)
        self._events: deque[tuple[int, int]] = deque()
        self._sum = 0

    def add(self, at_ns: int, amount: int = 1) -> None:
        """Count `amount` at `at_ns`."""
        self._events.append((at_ns, amount))
        self._sum += amount
        self._expire(at_ns)

    def per_second(self, now_ns: int, since_ns: int | None = None) -> float:
        """Rate in the window that ends now, shortened so as to begin no earlier than `since_ns`."""
        self._expire(now_ns)
        window_ns = self._window_ns
        if since_ns is None or now_ns - since_ns >= window_ns:
            return self._sum * 1e9 / window_ns
        window_ns = max(1, now_ns - since_ns)
        return sum(amount for at_ns, amount in self._events if at_ns > since_ns) * 1e9 / window_ns

    def _expire(self, now_ns: int) -> None:
        while self._events and self._events[0][0] <= now_ns - self._window_ns:
            self._sum -= self._events.popleft()[1]
