"""Which scans may leave, and when."""

from __future__ import annotations

from enum import Enum


class Refusal(Enum):
    """Why a scan was not sent."""

    NOT_CONNECTED = "not_connected"
    TOO_OLD = "too_old"
    NOT_NEW = "not_new"
    TOO_SOON = "too_soon"
    CONGESTED = "congested"
    LIMITS_CHANGED = "limits_changed"
    NO_ATTITUDE = "no_attitude"


class ObstacleGate:
    """Lets each frame through once, at the wanted rate, while it is fresh.

    Args:
        rate_hz: messages a second at most.
        max_age_ns: oldest capture that is sent.
    """

    def __init__(self, rate_hz: float, max_age_ns: int) -> None:
        self._period_ns = round(1e9 / rate_hz)
        self._max_age_ns = max_age_ns
        self._newest_captured_ns: int | None = None
        self._due_ns: int | None = None

    def refusal(self, captured_ns: int, now_ns: int) -> Refusal | None:
        """Why the frame captured at `captured_ns` may not be sent now; None if it may."""
        age_ns = now_ns - captured_ns
        if age_ns > self._max_age_ns or age_ns < 0:
            return Refusal.TOO_OLD
        if self._newest_captured_ns is not None and captured_ns <= self._newest_captured_ns:
            return Refusal.NOT_NEW
        if self._due_ns is not None and now_ns < self._due_ns:
            return Refusal.TOO_SOON
        return None

    def passed(self, captured_ns: int, now_ns: int) -> None:
        """A scan was sent. Up to a period is made up for, so that a camera's own rhythm keeps the mean."""
        self._newest_captured_ns = captured_ns
        earliest_ns = now_ns - self._period_ns
        self._due_ns = self._period_ns + (
            earliest_ns if self._due_ns is None else max(self._due_ns, earliest_ns)
        )
