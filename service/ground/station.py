"""The ground station put together."""

from __future__ import annotations

import socket
import threading
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Self

from service.clock import Clock, MonotonicClock
from service.errors import ConfigError
from service.ground.access import Access, check_token, is_loopback, make_token
from service.ground.app import GroundApp
from service.ground.errors import GroundError
from service.ground.fleet import Fleet
from service.ground.hub import Hub
from service.ground.listener import FleetListener
from service.ground.server import Tls, bind, make_server
from service.security.security import Security
from service.viewer_endpoints import viewer_endpoints

_POLL_S = 0.05


@dataclass(frozen=True)
class StationSettings:
    """What the command line says, checked.

    Args:
        connect, listen: Zenoh endpoints.
        port, bind: of the page.
        token: what browsers must know; None for a page on loopback.
        made_token: the token was made up here and has to be told.
        host_names: names of the station besides its addresses.
        tls: certificate of the page; None for plain HTTP.
        security: of the Zenoh sessions.
    """

    connect: tuple[str, ...]
    listen: tuple[str, ...]
    port: int
    bind: str
    token: str | None
    made_token: bool
    host_names: tuple[str, ...]
    tls: Tls | None
    security: Security | None = None

    @classmethod
    def checked(
        cls,
        *,
        config: Path | None,
        connect: Sequence[str],
        listen: Sequence[str],
        port: int,
        bind: str,
        token: str | None,
        host_names: Sequence[str],
        certificate: Path | None,
        key: Path | None,
    ) -> StationSettings:
        """Settings of which the ground station can be made.

        Raises:
            ConfigError: an option that cannot be used; the text names it.
        """
        zenoh = viewer_endpoints(config, connect, listen)
        if (certificate is None) != (key is None):
            raise ConfigError("--certificate and --key belong together: give both or neither")
        tls = None
        try:
            if certificate is not None and key is not None:
                tls = Tls(certificate, key)
                tls.check()
            made_token = token is None and not is_loopback(bind)
            token = make_token() if made_token else token
            if token is not None:
                check_token(token)
        except GroundError as error:
            raise ConfigError(str(error)) from error
        return cls(
            zenoh.connect, zenoh.listen, port, bind, token, made_token, tuple(host_names), tls, zenoh.security
        )


class Station:
    """Web server and Zenoh session. A context manager.

    Args:
        settings: checked.
        clock: ages everything.

    Raises:
        GroundError: a port in use, or an address that is none of this computer.
        PublisherError: a Zenoh endpoint that cannot be listened on.
    """

    def __init__(self, settings: StationSettings, clock: Clock | None = None) -> None:
        self._clock = clock = MonotonicClock() if clock is None else clock
        self._settings = settings
        with ExitStack() as stack:
            self._socket: socket.socket = stack.enter_context(bind(settings.bind, settings.port))
            fleet = Fleet(clock)
            self._listener = stack.enter_context(
                FleetListener(settings.listen, settings.connect, fleet, clock, settings.security)
            )
            hub = Hub(fleet, self._listener, (*settings.connect, *settings.listen), clock)
            access = Access(settings.token, settings.host_names)
            self._app = GroundApp(hub, access, settings.port, secure=settings.tls is not None)
            self._stack = stack.pop_all()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    @property
    def words(self) -> str:
        """What the user has to know to open the page."""
        settings = self._settings
        lines = [f"Ground station: {self.url}"]
        if settings.token is not None:
            if settings.made_token:
                lines.append("The part behind # is this run's token; --token keeps one for good.")
            if settings.tls is None and not is_loopback(settings.bind):
                lines.append(
                    "Plain HTTP: whoever listens on this network can read token and pictures; "
                    "--certificate and --key encrypt."
                )
        if settings.connect:
            lines.append(f"Vehicles are looked for at {', '.join(settings.connect)}.")
        if settings.listen:
            lines.append(f"Vehicles may connect to {', '.join(settings.listen)}.")
        lines.append("Ctrl-C ends it.")
        return "\n".join(lines)

    @property
    def url(self) -> str:
        """Address of the page, with the token if it was made here."""
        settings = self._settings
        host = settings.bind.strip("[]")
        if host in ("0.0.0.0", "::"):
            host = _outward_address(is_ipv6=host == "::") or socket.gethostname()
        if ":" in host:
            host = f"[{host}]"
        fragment = f"#token={settings.token}" if settings.made_token else ""
        return f"{'http' if settings.tls is None else 'https'}://{host}:{settings.port}/{fragment}"

    def await_peer(self, seconds: float) -> None:
        """Wait for a vehicle or router.

        Raises:
            GroundError: none was reached within so many seconds.
        """
        pause = threading.Event()
        end_ns = self._clock.now_ns() + round(seconds * 1e9)
        while self._listener.peer_count() == 0:
            if self._clock.now_ns() >= end_ns:
                places = ", ".join((*self._settings.connect, *self._settings.listen))
                raise GroundError(f"no vehicle or router was reached at {places} within {seconds:g} s")
            pause.wait(_POLL_S)

    def serve(self) -> None:
        """Serve until SIGINT or SIGTERM."""
        make_server(self._app.asgi, self._settings.tls).run(sockets=[self._socket])


def _outward_address(*, is_ipv6: bool) -> str | None:
    """The address that this computer would use towards others; nothing is sent to find it."""
    family, documentation = (socket.AF_INET6, "2001:db8::1") if is_ipv6 else (socket.AF_INET, "192.0.2.1")
    with socket.socket(family, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect((documentation, 9))
        except OSError:
            return None
        address: str = probe.getsockname()[0]
        return address
