"""A line to the autopilot: bytes, never blocking."""

from __future__ import annotations

from collections.abc import Hashable
from typing import Protocol

from service.autopilot.endpoint import Endpoint, SerialEndpoint, TcpEndpoint, UdpListenEndpoint
from service.autopilot.serial_transport import SerialTransport
from service.autopilot.tcp_transport import TcpTransport
from service.autopilot.udp_transport import UdpListenTransport, UdpSendTransport
from service.clock import Clock


class Transport(Protocol):
    """An open line. Every method returns at once and raises OSError when the line is lost."""

    def fileno(self) -> int:
        """Descriptor to wait on for bytes."""

    def receive(self) -> list[tuple[bytes, Hashable]]:
        """What has come, with its sender (None on a line with one other end)."""

    def send(self, frame: bytes, destination: Hashable) -> None:
        """Send one frame, or keep it until the line takes it."""

    def flush(self) -> None:
        """Send on what was kept, as far as the line takes it."""

    @property
    def pending_bytes(self) -> int:
        """Bytes kept because the line did not take them."""

    def close(self) -> None:
        """Close the line."""


def open_transport(endpoint: Endpoint, clock: Clock) -> Transport:
    """Open a line; takes at most a few seconds (TCP).

    Raises:
        OSError: the device is missing, the port is in use, the connection is refused, ...
    """
    if isinstance(endpoint, UdpListenEndpoint):
        return UdpListenTransport(endpoint.host, endpoint.port)
    if isinstance(endpoint, TcpEndpoint):
        return TcpTransport(endpoint.host, endpoint.port, clock)
    if isinstance(endpoint, SerialEndpoint):
        return SerialTransport(endpoint.device, endpoint.baud, clock)
    return UdpSendTransport(endpoint.host, endpoint.port)
