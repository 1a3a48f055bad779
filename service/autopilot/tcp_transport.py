"""MAVLink over a TCP connection that we open."""

from __future__ import annotations

import socket
from collections.abc import Hashable

from service.autopilot.stalled_write import StalledWrite
from service.clock import Clock

_CONNECT_TIMEOUT_S = 1.0
_READ_BYTES = 4096
_SEND_BUFFER_BYTES = 8192
"""Small: what the kernel keeps during a stall arrives late, and late obstacles are wrong ones."""


class TcpTransport:
    """A connection to a server such as SITL, a serial bridge or a router."""

    def __init__(self, host: str, port: int, clock: Clock) -> None:
        self._socket = socket.create_connection((host, port), timeout=_CONNECT_TIMEOUT_S)
        try:
            self._socket.setblocking(False)
            self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SEND_BUFFER_BYTES)
        except OSError:
            self._socket.close()
            raise
        self._out = StalledWrite(self._socket.send, clock)

    def fileno(self) -> int:
        return self._socket.fileno()

    def receive(self) -> list[tuple[bytes, Hashable]]:
        try:
            data = self._socket.recv(_READ_BYTES)
        except BlockingIOError:
            return []
        if not data:
            raise ConnectionResetError("the other end has closed the connection")
        return [(data, None)]

    def send(self, frame: bytes, destination: Hashable) -> None:
        del destination
        self._out.push(frame)

    def flush(self) -> None:
        self._out.push()

    @property
    def pending_bytes(self) -> int:
        return len(self._out)

    def close(self) -> None:
        self._socket.close()
