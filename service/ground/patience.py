"""Lets go of clients that do not finish: a few hundred silent ones would keep everybody else out."""

from __future__ import annotations

import asyncio
from typing import Final

import h11
from uvicorn.protocols.http.h11_impl import H11Protocol

REQUEST_S: Final = 5.0
"""From the connection or a request's first byte to its last: the page's are a few hundred bytes."""

RESPONSE_S: Final = 60.0
"""From there to the answer's last byte: the page takes 15 s on a link of 64 kbit/s."""


class ImpatientProtocol(H11Protocol):
    """HTTP with an end to waiting for requests and for answers to be taken.

    uvicorn itself has a time-out between two requests only.
    """

    _end: asyncio.TimerHandle | None = None
    _is_whole = False

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """A client came."""
        super().connection_made(transport)
        self._wait(REQUEST_S)

    def connection_lost(self, exc: Exception | None) -> None:
        """It went."""
        self._rest()
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        """Part of a request."""
        if self._end is None:
            self._wait(REQUEST_S)
        super().data_received(data)
        is_whole = self.conn.their_state not in (h11.IDLE, h11.SEND_BODY)
        if self._end is not None and is_whole and not self._is_whole:
            self._is_whole = True
            self._wait(RESPONSE_S)

    def on_response_complete(self) -> None:
        """The answer is taken; uvicorn waits for the next request."""
        self._rest()
        super().on_response_complete()

    def handle_websocket_upgrade(self, event: h11.Request) -> None:
        """From here on the WebSocket's own rules hold."""
        self._rest()
        super().handle_websocket_upgrade(event)

    def _wait(self, seconds: float) -> None:
        if self._end is not None:
            self._end.cancel()
        self._end = self.loop.call_later(seconds, self._let_go)

    def _rest(self) -> None:
        self._is_whole = False
        if self._end is not None:
            self._end.cancel()
            self._end = None

    def _let_go(self) -> None:
        self._end = None
        self.transport.abort()
