"""Where the autopilot is: one line of text, understood once."""

from __future__ import annotations

from dataclasses import dataclass

from service.errors import LinkError

ENDPOINT_FORMS = "udp:HOST:PORT (listen), udpout:HOST:PORT, tcp:HOST:PORT or serial:DEVICE:BAUD"

_MAX_BAUD = 12_000_000
"""Fastest rate of a USB full-speed port."""


@dataclass(frozen=True)
class UdpListenEndpoint:
    """Listen on `host`:`port` and answer whoever turns out to be the autopilot."""

    host: str
    port: int

    def __str__(self) -> str:
        return f"udp:{_bracketed(self.host)}:{self.port}"


@dataclass(frozen=True)
class UdpSendEndpoint:
    """Send to `host`:`port` and take what comes back from there."""

    host: str
    port: int

    def __str__(self) -> str:
        return f"udpout:{_bracketed(self.host)}:{self.port}"


@dataclass(frozen=True)
class TcpEndpoint:
    """Connect to a TCP server at `host`:`port`, as SITL and serial bridges offer it."""

    host: str
    port: int

    def __str__(self) -> str:
        return f"tcp:{_bracketed(self.host)}:{self.port}"


@dataclass(frozen=True)
class SerialEndpoint:
    """Serial port `device` at `baud` bits a second, 8N1, no flow control."""

    device: str
    baud: int

    def __str__(self) -> str:
        return f"serial:{self.device}:{self.baud}"


Endpoint = UdpListenEndpoint | UdpSendEndpoint | TcpEndpoint | SerialEndpoint


def parse_endpoint(text: str) -> Endpoint:
    """Understand an endpoint.

    Args:
        text: "udp:HOST:PORT", "udpout:HOST:PORT", "tcp:HOST:PORT" or "serial:DEVICE:BAUD"; an IPv6 host
            stands in brackets. Port 0 is allowed for udp only and takes a free port.

    Raises:
        LinkError: anything else; the text names the value and the forms.
    """
    kind, _, rest = text.partition(":")
    place, separator, number = rest.rpartition(":")
    if kind not in ("udp", "udpout", "tcp", "serial") or not separator or not place:
        raise LinkError(f"autopilot endpoint {text!r} is not understood: {ENDPOINT_FORMS} is needed")
    if kind == "serial":
        return SerialEndpoint(place, _number(text, "baud", number, 1, _MAX_BAUD))
    host = place[1:-1] if place.startswith("[") and place.endswith("]") else place
    if not _is_host(host) or (":" in host and host == place):
        raise LinkError(f"autopilot endpoint {text!r} has host {place!r}: {ENDPOINT_FORMS} is needed")
    if kind == "udp":
        return UdpListenEndpoint(host, _number(text, "port", number, 0, 65535))
    port = _number(text, "port", number, 1, 65535)
    return UdpSendEndpoint(host, port) if kind == "udpout" else TcpEndpoint(host, port)


def _number(text: str, name: str, digits: str, low: int, high: int) -> int:
    if not (digits.isascii() and digits.isdigit() and len(digits) <= 9 and low <= int(digits) <= high):
        raise LinkError(
            f"autopilot endpoint {text!r} has {name} {digits!r}: a whole number from {low} to {high} is "
            f"needed ({ENDPOINT_FORMS})"
        )
    return int(digits)


def _is_host(host: str) -> bool:
    try:
        host.encode("idna")  # what the resolver would raise on: empty or overlong labels
    except UnicodeError:
        return False
    return bool(host) and host.isprintable() and " " not in host


def _bracketed(host: str) -> str:
    return f"[{host}]" if ":" in host else host
