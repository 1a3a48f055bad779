"""When the next picture may go: the budget's bytes, spread evenly, shared between topics."""

from __future__ import annotations


class Pacer:
    """Spreads pictures so that no more than the budget leaves in any stretch of time.

    Args:
        shares: part of the budget of each topic; together 1.
    """

    def __init__(self, shares: dict[str, float]) -> None:
        self._shares = shares
        self._any_due_ns = 0
        self._due_ns = dict.fromkeys(shares, 0)

    def allows(self, topic: str, now_ns: int) -> bool:
        """Whether a picture of `topic` may go now."""
        return now_ns >= self._any_due_ns and now_ns >= self._due_ns[topic]

    def sent(self, topic: str, size_bytes: int, bytes_per_s: float, now_ns: int) -> None:
        """A picture went: hold back what comes next."""
        whole_ns = round(1e9 * size_bytes / bytes_per_s)
        self._any_due_ns = now_ns + whole_ns
        self._due_ns[topic] = now_ns + round(whole_ns / self._shares[topic])
