"""What several tests of the service stand on."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from contextlib import closing

import pytest
from link_peers import PATIENCE_S


@pytest.fixture
def server() -> Iterator[socket.socket]:
    """A TCP socket of the loopback that listens."""
    with closing(socket.create_server(("127.0.0.1", 0))) as listening:
        listening.settimeout(PATIENCE_S)
        yield listening
