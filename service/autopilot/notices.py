"""What the link has to say to a log: each thing once, until it is over."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Notice:
    """One line for the log.

    Args:
        problem: True for trouble, False for good news.
        text: fit to show a user.
    """

    problem: bool
    text: str


class Notices:
    """Collects notices. A problem has a key, is told once, and stands until it is over."""

    def __init__(self) -> None:
        self._standing: dict[str, str] = {}
        self._untold: list[Notice] = []

    def problem(self, key: str, text: str) -> None:
        """A problem stands. Told once; a changed text only updates what stands."""
        if key not in self._standing:
            self._untold.append(Notice(True, text))
        self._standing[key] = text

    def over(self, key: str) -> bool:
        """The problem is over; True if it stood."""
        return self._standing.pop(key, None) is not None

    def news(self, text: str) -> None:
        """Something good or neutral happened."""
        self._untold.append(Notice(False, text))

    @property
    def standing(self) -> str | None:
        """The problem that has stood longest, or None."""
        return next(iter(self._standing.values()), None)

    def take(self) -> list[Notice]:
        """What has not been told yet."""
        untold, self._untold = self._untold, []
        return untold
