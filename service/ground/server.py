"""The web server: its socket is taken before anything else starts, so that a port in use is told at once."""

from __future__ import annotations

import errno
import socket
import ssl
from dataclasses import dataclass
from pathlib import Path

import uvicorn
from starlette.types import ASGIApp

from service.ground.browser import MAX_MESSAGE_BYTES
from service.ground.errors import GroundError
from service.ground.patience import ImpatientProtocol

_BACKLOG = 64
_MAX_CONNECTIONS = 200
_MAX_HEADER_BYTES = 16_384
_SHUTDOWN_S = 2


@dataclass(frozen=True)
class Tls:
    """Certificate of the web server.

    Args:
        certificate, key: PEM files.
    """

    certificate: Path
    key: Path

    def check(self) -> None:
        """Raises GroundError for files that are missing, unreadable or no pair."""
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        try:
            # Without a password function an encrypted key would have OpenSSL ask at the terminal.
            context.load_cert_chain(self.certificate, self.key, password=lambda: "")
        except (OSError, ssl.SSLError) as error:
            reason = error.strerror or error
            raise GroundError(
                f"certificate {self.certificate} with key {self.key} cannot be used: {reason}"
            ) from error


def bind(address: str, port: int) -> socket.socket:
    """A socket that listens on `address` and `port`.

    Raises:
        GroundError: a port in use or forbidden, or an address that this computer does not have.
    """
    try:
        family, kind, protocol, _, place = socket.getaddrinfo(address, port, type=socket.SOCK_STREAM)[0]
    except OSError as error:
        raise GroundError(
            f"--bind {address}: no address of this computer ({error.strerror or error})"
        ) from error
    server = socket.socket(family, kind, protocol)
    try:
        server.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        server.bind(place)
        server.listen(_BACKLOG)
    except OSError as error:
        server.close()
        raise GroundError(f"--port {port} on {address}: {_reason(error)}") from error
    return server


def make_server(app: ASGIApp, tls: Tls | None) -> uvicorn.Server:
    """The web server; its `run` serves on sockets that `bind` made, until SIGINT or SIGTERM."""
    config = uvicorn.Config(
        app,
        log_config=None,
        log_level="warning",
        access_log=False,
        lifespan="on",
        http=ImpatientProtocol,
        ws="websockets-sansio",
        ws_max_size=MAX_MESSAGE_BYTES,
        # Pictures are compressed already, and JSON of a few kB is not worth the processor time.
        ws_per_message_deflate=False,
        server_header=False,
        proxy_headers=False,
        limit_concurrency=_MAX_CONNECTIONS,
        h11_max_incomplete_event_size=_MAX_HEADER_BYTES,
        timeout_graceful_shutdown=_SHUTDOWN_S,
        ssl_certfile=None if tls is None else tls.certificate,
        ssl_keyfile=None if tls is None else tls.key,
    )
    return uvicorn.Server(config)


def _reason(error: OSError) -> str:
    if error.errno == errno.EADDRINUSE:
        return "in use by another program; choose another with --port"
    if error.errno == errno.EADDRNOTAVAIL:
        return "no address of this computer"
    if error.errno == errno.EACCES:
        return "not allowed for this user; ports from 1024 on are"
    return error.strerror or str(error)
