"""One Zenoh session towards the ground that is had again and again."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress

import zenoh

from service.errors import PublisherError
from service.security.errors import SecurityError
from service.security.security import Security

RETRY_NS = 2_000_000_000

Open = Callable[[Sequence[str], Sequence[str]], zenoh.Session]


class Line:
    """A session that is opened when it is needed, and anew after it broke. For one thread.

    Args:
        listen, connect: endpoints.
        open_session: opens a session on them.
        opened: declares what the session is for.
        security: whose certificate may be out of date, which is told.
    """

    def __init__(
        self,
        listen: Sequence[str],
        connect: Sequence[str],
        open_session: Open,
        opened: Callable[[Line, zenoh.Session], None],
        security: Security | None = None,
    ) -> None:
        self._listen, self._connect = tuple(listen), tuple(connect)
        self._open_session = open_session
        self._opened = opened
        self._security = security
        self._due_ns: int | None = None
        self.session: zenoh.Session | None = None
        """The session, None while it cannot be had."""
        self.problem = ""
        """Why not, or who is away; empty if all is well."""

    def keep(self, now_ns: int) -> None:
        """Open the session if there is none and the last attempt is 2 s ago."""
        if self.session is not None or (self._due_ns is not None and now_ns < self._due_ns):
            return
        self._due_ns = now_ns + RETRY_NS
        try:
            session = self._open_session(self._listen, self._connect)
            self._opened(self, session)
            self.problem, self.session = "", session
        except (PublisherError, SecurityError, zenoh.ZError) as error:
            self.drop(str(error))

    def drop(self, problem: str) -> None:
        """Close the session because of `problem`; `keep` opens it anew."""
        self.close()
        self.problem = problem

    def close(self) -> None:
        """Close the session."""
        session, self.session = self.session, None
        if session is not None:
            with suppress(zenoh.ZError):  # it is closed for good either way
                session.close()  # type: ignore[no-untyped-call]

    def look(self) -> int:
        """Count the peers and routers that are there, and notice if none is at `connect`."""
        if self.session is None:
            return 0
        peers = len(self.session.info.peers_zid()) + len(self.session.info.routers_zid())
        away = bool(self._connect) and peers == 0
        problem = f"no peer at {', '.join(self._connect)}; tried again" if away else ""
        if peers == 0 and self._security is not None:
            problem = _validity(self._security) or problem
        self.problem = problem
        return peers


def _validity(security: Security) -> str | None:
    try:
        return security.validity_problem()
    except SecurityError as error:
        return str(error)
