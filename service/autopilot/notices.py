"""What the link has to say to a log: each thing once, until it is over."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum


class Problem(IntEnum):
    """What can be wrong with the link, the worst first."""

    LINE = 1
    SIGNING = 2
    SILENT = 3
    MAVLINK1 = 4
    SLOW_LINE = 5
    STREAMS = 6
    FOREIGN = 7


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
    """Collects notices. A problem is told once and stands until it is over."""

    def __init__(self) -> None:
        self._standing: dict[Problem, str] = {}
        self._untold: list[Notice] = []

    def problem(self, problem: Problem, text: str) -> None:
        """A problem stands. Told once; a changed text only updates what stands."""
        if problem not in self._standing:
            self._untold.append(Notice(True, text))
        self._standing[problem] = text

    def over(self, problem: Problem) -> bool:
        """The problem is over; True if it stood."""
        return self._standing.pop(problem, None) is not None

    def news(self, text: str) -> None:
        """Something good or neutral happened."""
        self._untold.append(Notice(False, text))

    @property
    def standing(self) -> str | None:
        """The worst problem that stands, or None."""
        return self._standing[min(self._standing)] if self._standing else None

    def take(self) -> list[Notice]:
        """What has not been told yet."""
        untold, self._untold = self._untold, []
        return untold
