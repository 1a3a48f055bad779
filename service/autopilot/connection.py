"""Whether there is a line, and an autopilot at its other end."""

from __future__ import annotations

from service.autopilot.link_watch import LinkWatch
from service.autopilot.notices import Notices, Problem


class Connection:
    """Open or not, heard or silent, and what is told of it.

    Args:
        endpoint: of the line.
        timeout_ns: silence after which the autopilot counts as lost.
        notices: where the line's troubles are told.
        watch: where silence is told.
    """

    def __init__(self, endpoint: str, timeout_ns: int, notices: Notices, watch: LinkWatch) -> None:
        self._endpoint = endpoint
        self._timeout_ns = timeout_ns
        self._notices = notices
        self._watch = watch
        self._opened_ns = 0
        self._heard_ns: int | None = None
        self.is_open = False
        """The socket or port is open, whoever is at the other end."""
        self.losses = 0
        """Times that an open line was lost."""

    def opened(self, now_ns: int) -> None:
        """The socket or port is open."""
        self.is_open, self._opened_ns = True, now_ns
        if self._notices.over(Problem.LINE):
            self._notices.news(f"autopilot line {self._endpoint} is open")

    def failed(self, reason: str) -> None:
        """The socket or port could not be opened, or was lost; it is being tried again."""
        self.losses += self.is_open
        self.is_open = False
        self._notices.problem(Problem.LINE, f"autopilot line {self._endpoint}: {reason}; trying again")

    def new_vehicle(self) -> None:
        """Another autopilot is listened to from now on."""
        self._heard_ns = None

    def heard(self, arrival_ns: int) -> bool:
        """The autopilot has spoken; True if it is its first word, or the first after a silence."""
        is_back = not self.is_up(arrival_ns)
        if is_back and self._heard_ns is not None:
            self._notices.news(f"autopilot is back after {(arrival_ns - self._heard_ns) / 1e9:.1f} s")
        self._heard_ns = arrival_ns
        return is_back

    def is_up(self, now_ns: int) -> bool:
        """Whether the line is open and the autopilot was heard lately."""
        return self.is_open and self._heard_ns is not None and now_ns - self._heard_ns <= self._timeout_ns

    def check(self, now_ns: int, was_known: bool) -> None:
        """Tell silence, and its end.

        Args:
            was_known: an autopilot has been heard on this link.
        """
        if self.is_up(now_ns):
            self._watch.connected()
        elif now_ns - max(self._opened_ns, self._heard_ns or 0) > self._timeout_ns:
            self._watch.silent(was_heard=was_known)
