"""A line to the fake autopilot that is only memory: bytes in, bytes out, no sockets."""

from __future__ import annotations

from service.fake_autopilot.endpoint import Endpoint, Peer

_PEER: Peer = 0


class MemoryEndpoint(Endpoint):
    """An endpoint with one peer that is there from the start."""

    address = "memory"

    def __init__(self) -> None:
        self._joined: list[Peer] = [_PEER]
        self._to_autopilot: list[bytes] = []
        self._to_companion: list[bytes] = []

    def put(self, data: bytes) -> None:
        """Bytes from the companion."""
        self._to_autopilot.append(data)

    def take(self) -> list[bytes]:
        """Packets for the companion since the last call."""
        packets, self._to_companion = self._to_companion, []
        return packets

    def poll(self) -> tuple[list[Peer], list[Peer], list[tuple[Peer, bytes]]]:
        joined, self._joined = self._joined, []
        received, self._to_autopilot = [(_PEER, data) for data in self._to_autopilot], []
        return joined, [], received

    def send(self, peer: Peer, data: bytes) -> None:
        self._to_companion.append(data)

    def close_peers(self) -> None:
        self._to_autopilot.clear()
        self._to_companion.clear()

    def close(self) -> None:
        self.close_peers()
