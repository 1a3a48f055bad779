"""Zenoh sessions as this project opens them: explicit endpoints and nothing else."""

from __future__ import annotations

import json
import re
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from enum import Enum

import zenoh

from service.errors import PublisherError
from service.security.security import Security

_LEASE_MS = 2000
"""A peer that froze is noticed after 1.9 s with it, after 10 s by default (measured)."""

SEND_BUFFER_BYTES = 16_384
"""With the system's own buffers a link of 2 Mbit/s ran 3.2 s late, with this one 0.4 s (measured)."""

MAX_MESSAGE_BYTES = 4_194_304
"""No picture is near it; by default a peer may have a gigabyte of memory reserved for one message."""

_CLOSE_S = 0.5

_SOURCE_PLACE = re.compile(r" at \S+\.rs:\d+\.?\]?")


class Role(Enum):
    """What a session is to the others; its value is Zenoh's mode.

    Vehicles are peers: a router hands nothing from one peer to another, so vehicles never hear each other.
    Stations and routers are Zenoh routers: they hear peers directly and through other routers, reach any
    number of endpoints and find them again by themselves.
    """

    VEHICLE = "peer"
    STATION = "router"


def open_session(
    listen: Sequence[str],
    connect: Sequence[str],
    security: Security | None = None,
    role: Role = Role.VEHICLE,
) -> zenoh.Session:
    """Open a session without multicast, gossip and shared memory.

    Whoever is away in `connect` is no error: the session reaches them by itself when they come.

    Args:
        listen: endpoints to listen on, `tcp/host:port` or `tls/host:port`.
        connect: endpoints of vehicles or routers.
        security: certificates, passwords and access list; None: none of them.
        role: what the session is to the others.

    Raises:
        SecurityError: a certificate, key or password that cannot be used.
        PublisherError: an endpoint that cannot be listened on, the text says which and why.
    """
    config = zenoh.Config()
    options = {
        "mode": role.value,
        "listen/endpoints": list(listen),
        "connect/endpoints": list(connect),
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        # Drops samples without a word (eclipse-zenoh/zenoh #2628).
        "transport/shared_memory/enabled": False,
        "transport/link/tx/lease": _LEASE_MS,
        "transport/link/rx/max_message_size": MAX_MESSAGE_BYTES,
        "transport/link/tcp/so_sndbuf": SEND_BUFFER_BYTES,
        "transport/link/tls/so_sndbuf": SEND_BUFFER_BYTES,
    }
    if security is not None:
        security.check(listen, connect)
        options |= security.options(connect)
    try:
        for option, value in options.items():
            config.insert_json5(option, json.dumps(value))
        return zenoh.open(config)
    except zenoh.ZError as error:
        raise PublisherError(f"zenoh: {_reason(str(error), listen)}") from error


@contextmanager
def station_session(
    listen: Sequence[str], connect: Sequence[str], security: Security | None = None
) -> Iterator[zenoh.Session]:
    """A station's or router's session for as long as the block lasts; see `open_session` and `close_soon`."""
    session = open_session(listen, connect, security, Role.STATION)
    try:
        yield session
    finally:
        close_soon(session)


def close_soon(session: zenoh.Session) -> None:
    """Close a session; one that takes long (its peer accepts and says nothing: 15 s) is left to a thread."""

    def close() -> None:
        with suppress(zenoh.ZError):  # it is closed for good either way
            session.close()  # type: ignore[no-untyped-call]

    thread = threading.Thread(target=close, name="zenoh-close", daemon=True)
    thread.start()
    thread.join(_CLOSE_S)


def _reason(text: str, listen: Sequence[str]) -> str:
    """Zenoh's error without the places in its own source."""
    endpoints = ", ".join(listen)
    if "in use" in text:
        return f"{_named(text, listen) or endpoints} is in use by another program"
    if "assign requested address" in text:
        return f"{_named(text, listen) or endpoints} is no address of this computer"
    return f"{endpoints or 'session'}: {_SOURCE_PLACE.sub('', text).strip()}"


def _named(text: str, listen: Sequence[str]) -> str | None:
    return next((endpoint for endpoint in listen if endpoint.split("#")[0] in text), None)
