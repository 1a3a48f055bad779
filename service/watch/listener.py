"""The viewer's Zenoh session: it feeds a board."""

from __future__ import annotations

from types import TracebackType
from typing import Self

import zenoh

from service.clock import Clock
from service.publisher import keys
from service.publisher.session import open_session
from service.watch.board import Board


class Listener:
    """Subscribes to scans, status and liveliness of all vehicles. A context manager.

    Args:
        connect: endpoint of the vehicle or router; one that is away is reached when it comes.
        board: takes the samples.
        clock: ages them.

    Raises:
        PublisherError: a session that cannot be opened.
    """

    def __init__(self, connect: str, board: Board, clock: Clock) -> None:
        self._board = board
        self._clock = clock
        self._session = open_session([], [connect])
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
