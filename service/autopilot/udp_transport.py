"""MAVLink over UDP: datagrams are lost, repeated or refused, and none of that is the end of the line."""

from __future__ import annotations

import socket
from collections.abc import Hashable

_MAX_DATAGRAMS = 64
"""Datagrams taken in one go, so that sending never waits for a flood to end."""

_DATAGRAM_BYTES = 65536


class _UdpTransport:
    """What both kinds have in common."""

    def __init__(self, family: int) -> None:
        self._socket = socket.socket(family, socket.SOCK_DGRAM)
        self._socket.setblocking(False)

    def fileno(self) -> int:
        return self._socket.fileno()

    def receive(self) -> list[tuple[bytes, Hashable]]:
        received: list[tuple[bytes, Hashable]] = []
        for _ in range(_MAX_DATAGRAMS):
            try:
                received.append(self._socket.recvfrom(_DATAGRAM_BYTES))
            except BlockingIOError:
                break
            except ConnectionError:
                continue  # the other end is not there yet: its refusal of an earlier datagram
        return received

    def flush(self) -> None:
        return

    @property
    def pending_bytes(self) -> int:
        return 0

    def close(self) -> None:
        self._socket.close()


class UdpListenTransport(_UdpTransport):
    """Bound to a port; answers where the vehicle speaks from."""

    def __init__(self, host: str, port: int) -> None:
        family, address = _resolve(host, port)
        super().__init__(family)
        try:
            self._socket.bind(address)
        except OSError:
            self._socket.close()
            raise

    @property
    def port(self) -> int:
        """The port that is bound."""
        return int(self._socket.getsockname()[1])

    def send(self, frame: bytes, destination: Hashable) -> None:
        if not isinstance(destination, tuple):
            return  # nobody is known to send to yet
        try:
            self._socket.sendto(frame, destination)
        except OSError:
            return  # full, unreachable, refused: a lost datagram


class UdpSendTransport(_UdpTransport):
    """Connected to one address: only what comes from there is taken."""

    def __init__(self, host: str, port: int) -> None:
        family, address = _resolve(host, port)
        super().__init__(family)
        try:
            self._socket.connect(address)
        except OSError:
            self._socket.close()
            raise

    def receive(self) -> list[tuple[bytes, Hashable]]:
        return [(data, None) for data, _ in super().receive()]

    def send(self, frame: bytes, destination: Hashable) -> None:
        del destination
        try:
            self._socket.send(frame)
        except OSError:
            return


def _resolve(host: str, port: int) -> tuple[int, tuple[str, int] | tuple[str, int, int, int]]:
    family, _, _, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
    return family, address  # type: ignore[return-value]
