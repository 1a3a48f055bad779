"""How often something may pass."""

from __future__ import annotations


class RateLimit:
    """Lets through what does not come too soon.

    Args:
        rate_hz: how often at most.
    """

    def __init__(self, rate_hz: float) -> None:
        self._period_ns = round(1e9 / rate_hz)
        self._due_ns: int | None = None

    def allows(self, now_ns: int) -> bool:
        """Whether something may pass now; if so it is counted."""
        if self._due_ns is not None and now_ns < self._due_ns:
            return False
        # Half a period late is made up for, so that the source's own rhythm does not lower the rate.
        earliest_ns = now_ns - self._period_ns // 2
        self._due_ns = max(self._due_ns or earliest_ns, earliest_ns) + self._period_ns
        return True
