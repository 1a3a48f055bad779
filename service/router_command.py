"""`uavdepth router`."""

from __future__ import annotations

import signal
import threading
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from service.security.options import SecurityConfigOption

if TYPE_CHECKING:
    from service.settings.zenoh import ZenohSettings

_POLL_S = 1.0


def router(
    config: SecurityConfigOption = None,
    listen: Annotated[
        list[str] | None,
        typer.Option(help="Endpoint for vehicles and stations, in place of the configured ones; many times."),
    ] = None,
    connect: Annotated[
        list[str] | None, typer.Option(help="Endpoint of another router; may be given many times.")
    ] = None,
) -> None:
    """Hand on between vehicles and ground stations in different networks, until interrupted.

    Vehicles and stations connect to it; vehicles do not hear each other. Without a file it listens on the
    loopback alone.
    """
    import structlog

    from service.log_setup import set_up_logging
    from service.publisher.session import station_session
    from service.security.errors import SecurityError
    from service.settings.log import LogSettings

    settings = router_settings(config, listen, connect)
    problem = settings.security.validity_problem()
    if problem is not None:
        raise SecurityError(problem)
    set_up_logging(LogSettings())
    log = structlog.get_logger()
    stop = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda _number, _frame: stop.set())
    with station_session(settings.listen, settings.connect, settings.security) as session:
        log.info("router", listens_at=", ".join(settings.listen), connects_to=", ".join(settings.connect))
        known = -1
        while not stop.is_set():
            vehicles, others = len(session.info.peers_zid()), len(session.info.routers_zid())
            if vehicles + others != known:
                known = vehicles + others
                log.info("connected", vehicle_sessions=vehicles, station_and_router_sessions=others)
            stop.wait(_POLL_S)


def router_settings(
    config: Path | None, listen: list[str] | None, connect: list[str] | None
) -> ZenohSettings:
    """The router's `[zenoh]`, command line over file.

    Raises:
        ConfigError: an endpoint that is none, or nothing to listen on.
        SecurityError: certificates, keys or passwords that cannot be used.
    """
    import json

    from service.errors import ConfigError
    from service.security.options import load_zenoh_settings

    overrides = tuple(
        f"zenoh.{key}={json.dumps(given)}"
        for key, given in (("listen", listen), ("connect", connect))
        if given
    )
    settings = load_zenoh_settings(config, overrides)
    if not settings.listen:
        raise ConfigError("[zenoh] listen is empty: a router needs an endpoint to listen on")
    return settings
