"""Zenoh sessions as this project opens them: explicit endpoints and nothing else."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence

import zenoh

from service.errors import PublisherError

_LEASE_MS = 2000
"""A peer that froze is noticed after 1.9 s with it, after 10 s by default (measured)."""

_SOURCE_PLACE = re.compile(r" at \S+\.rs:\d+\.?\]?")


def open_session(listen: Sequence[str], connect: Sequence[str]) -> zenoh.Session:
    """Open a peer session without multicast, gossip and shared memory.

    Peers in `connect` that are away are no error: the session reaches them by itself when they come.

    Args:
        listen: endpoints to listen on, `tcp/host:port`.
        connect: endpoints of peers or routers.

    Raises:
        PublisherError: an endpoint that cannot be listened on, the text says which and why.
    """
    config = zenoh.Config()
    options = {
        "mode": "peer",
        "listen/endpoints": list(listen),
        "connect/endpoints": list(connect),
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        # Drops samples without a word (eclipse-zenoh/zenoh #2628).
        "transport/shared_memory/enabled": False,
        "transport/link/tx/lease": _LEASE_MS,
    }
    try:
        for option, value in options.items():
            config.insert_json5(option, json.dumps(value))
        return zenoh.open(config)
    except zenoh.ZError as error:
        raise PublisherError(f"zenoh: {_reason(str(error), listen)}") from error


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
