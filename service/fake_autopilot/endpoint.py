"""Sockets of the fake autopilot: bytes in and out, several peers, nothing that waits."""

from __future__ import annotations

import socket
from abc import ABC, abstractmethod

from service.errors import LinkError

RECEIVE_BYTES = 65536
SEND_BUFFER_BYTES = 1 << 20

Peer = int
"""Number of a peer of one endpoint, never used twice."""


class Endpoint(ABC):
    """Where peers connect to, or where one is. All calls return at once."""

    address: str
    """The endpoint as opened; with TCP port 0 the port is the one that the system chose."""

    @abstractmethod
    def poll(self) -> tuple[list[Peer], list[Peer], list[tuple[Peer, bytes]]]:
        """New peers, peers that have gone, and what was received since the last call."""

    @abstractmethod
    def send(self, peer: Peer, data: bytes) -> None:
        """Send to one peer; a peer that does not read loses what it does not take."""

    @abstractmethod
    def close_peers(self) -> None:
        """Drop every connection; the peers are reported as gone."""

    @abstractmethod
    def close(self) -> None:
        """Close everything."""


def open_endpoint(text: str) -> Endpoint:
    """Open `tcp:HOST:PORT` or `udp:HOST:PORT` (listen) or `udpout:HOST:PORT` (send there).

    Raises:
        LinkError: the text is none of these, or the port cannot be had.
    """
    kind, _, rest = text.partition(":")
    host, _, port_text = rest.rpartition(":")
    if (
        kind not in ("tcp", "udp", "udpout")
        or not host
        or not port_text.isdecimal()
        or int(port_text) > 65535
    ):
        raise LinkError(f"endpoint {text!r} is none of tcp:HOST:PORT, udp:HOST:PORT, udpout:HOST:PORT")
    port = int(port_text)
    if kind == "udpout" and port == 0:
        raise LinkError(f"endpoint {text!r}: port 0 cannot be sent to")
    try:
        if kind == "tcp":
            return TcpListener(host, port)
        return UdpPort(host, port, listens=kind == "udp")
    except OSError as error:
        raise LinkError(f"endpoint {text!r} cannot be opened: {error.strerror or error}") from error


class TcpListener(Endpoint):
    """A listening TCP port, as a simulator offers; each client is a peer."""

    def __init__(self, host: str, port: int) -> None:
        self._listener = socket.create_server((host, port), backlog=8)
        self._listener.setblocking(False)
        self.address = f"tcp:{host}:{self._listener.getsockname()[1]}"
        self._clients: dict[Peer, socket.socket] = {}
        self._unsent: dict[Peer, bytearray] = {}
        self._next_peer = 0
        self._gone: list[Peer] = []

    def poll(self) -> tuple[list[Peer], list[Peer], list[tuple[Peer, bytes]]]:
        joined = self._accept()
        received: list[tuple[Peer, bytes]] = []
        for peer, client in list(self._clients.items()):
            try:
                data = client.recv(RECEIVE_BYTES)
            except BlockingIOError:
                continue
            except OSError:
                data = b""
            if data:
                received.append((peer, data))
            else:
                self._drop(peer)
        gone, self._gone = self._gone, []
        return joined, gone, received

    def send(self, peer: Peer, data: bytes) -> None:
        client = self._clients.get(peer)
        if client is None:
            return
        unsent = self._unsent[peer]
        if len(unsent) + len(data) > SEND_BUFFER_BYTES:
            return
        unsent += data
        try:
            sent = client.send(unsent)
        except BlockingIOError:
            return
        except OSError:
            self._drop(peer)
            return
        del unsent[:sent]

    def close_peers(self) -> None:
        for peer in list(self._clients):
            self._drop(peer)

    def close(self) -> None:
        self.close_peers()
        self._listener.close()

    def _accept(self) -> list[Peer]:
        joined: list[Peer] = []
        while True:
            try:
                client, _ = self._listener.accept()
            except BlockingIOError:
                return joined
            client.setblocking(False)
            client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            peer = self._next_peer
            self._next_peer += 1
            self._clients[peer] = client
            self._unsent[peer] = bytearray()
            joined.append(peer)

    def _drop(self, peer: Peer) -> None:
        client = self._clients.pop(peer, None)
        if client is not None:
            del self._unsent[peer]
            client.close()
            self._gone.append(peer)


class UdpPort(Endpoint):
    """A UDP port: one that sends to a fixed address, or one that answers everybody who has sent to it."""

    def __init__(self, host: str, port: int, listens: bool) -> None:
        family = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0][0]
        self._socket = socket.socket(family, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._peers: dict[tuple[str, int], Peer] = {}
        self._joined: list[Peer] = []
        if listens:
            try:
                self._socket.bind((host, port))
            except OSError:
                self._socket.close()
                raise
            self.address = f"udp:{host}:{self._socket.getsockname()[1]}"
        else:
            self._join((str(socket.getaddrinfo(host, port, family)[0][4][0]), port))
            self.address = f"udpout:{host}:{port}"
        self._listens = listens

    def poll(self) -> tuple[list[Peer], list[Peer], list[tuple[Peer, bytes]]]:
        received: list[tuple[Peer, bytes]] = []
        while True:
            try:
                data, sender = self._socket.recvfrom(RECEIVE_BYTES)
            except BlockingIOError:
                break
            except OSError:
                continue  # an ICMP "port unreachable": the other side is not there yet
            address = (str(sender[0]), int(sender[1]))
            if self._listens and address not in self._peers:
                self._join(address)
            if address in self._peers:
                received.append((self._peers[address], data))
        joined, self._joined = self._joined, []
        return joined, [], received

    def send(self, peer: Peer, data: bytes) -> None:
        for address, number in self._peers.items():
            if number == peer:
                try:
                    self._socket.sendto(data, address)
                except OSError:
                    return  # nobody there: as on a radio, the datagram is gone

    def close_peers(self) -> None:
        """There is no connection to drop."""

    def close(self) -> None:
        self._socket.close()

    def _join(self, address: tuple[str, int]) -> None:
        self._peers[address] = len(self._peers)
        self._joined.append(self._peers[address])
