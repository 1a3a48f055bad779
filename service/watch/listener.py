"""The viewer's Zenoh session: it feeds a board."""

from __future__ import annotations

from collections.abc import Sequence
from types import TracebackType
from typing import Self

import zenoh

from service.clock import Clock
from service.publisher import keys
from service.publisher.session import Role, open_session
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
        self._board = board
        self._clock = clock
        self._session = open_session(listen, connect, security, Role.STATION)
        for topic in (keys.SCAN, keys.STATUS):
            self._session.declare_subscriber(keys.key("*", topic), self._hear)
        self._session.liveliness().declare_subscriber(
            keys.key("*", keys.ALIVE), self._hear_alive, history=True
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        """Close the session."""
        self._session.close()  # type: ignore[no-untyped-call]

    def _hear(self, sample: zenoh.Sample) -> None:
        self._board.hear(str(sample.key_expr), sample.payload.to_bytes(), self._clock.now_ns())

    def _hear_alive(self, sample: zenoh.Sample) -> None:
        self._board.hear_alive(str(sample.key_expr), sample.kind == zenoh.SampleKind.PUT)
