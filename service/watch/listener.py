"""The viewer's Zenoh session: it feeds a board."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Self

from service.clock import Clock
from service.publisher.session import Role, close_soon, open_session
from service.publisher.vehicle_samples import hear_vehicles
from service.security.security import Security
from service.watch.board import Board


class Listener:
    """Subscribes to scans, status and liveliness of all vehicles. A context manager.

    Args:
        connect: endpoints of vehicles or routers; one that is away is reached when it comes.
        board: takes the samples.
        clock: ages them.
        listen: endpoints where vehicles connect.
        security: certificates and passwords; None: none of them.

    Raises:
        SecurityError: certificates, keys or passwords that cannot be used.
        PublisherError: a session that cannot be opened.
    """

    def __init__(
        self,
        connect: Sequence[str],
        board: Board,
        clock: Clock,
        listen: Sequence[str] = (),
        security: Security | None = None,
    ) -> None:
        self._session = open_session(listen, connect, security, Role.STATION)
        hear_vehicles(
            self._session,
            lambda key, payload: board.hear(key, payload, clock.now_ns()),
            board.hear_alive,
            board.bad_samples,
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the session."""
        close_soon(self._session)
