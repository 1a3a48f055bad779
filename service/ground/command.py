"""`uavdepth ground`."""

from __future__ import annotations

import signal
from pathlib import Path
from typing import Annotated

import typer

from service.security.options import SecurityConfigOption
from service.viewer_endpoints import ConnectOption

TOKEN_VARIABLE = "UAVDEPTH_GROUND_TOKEN"


def ground(
    config: SecurityConfigOption = None,
    connect: ConnectOption = None,
    listen: Annotated[
        list[str] | None, typer.Option(help="Zenoh endpoint where vehicles connect; may be given many times.")
    ] = None,
    port: Annotated[int, typer.Option(min=1, max=65535, help="Port of the page.")] = 8080,
    bind: Annotated[
        str, typer.Option(help="Address of the page; anything but loopback asks browsers for a token.")
    ] = "127.0.0.1",
    token: Annotated[
        str | None,
        typer.Option(
            envvar=TOKEN_VARIABLE,
            help="What browsers must know; 16 letters or more. Made and printed where one is needed.",
        ),
    ] = None,
    host_name: Annotated[
        list[str] | None,
        typer.Option(help="A name that browsers may call this station by; addresses always work."),
    ] = None,
    certificate: Annotated[
        Path | None, typer.Option(help="PEM certificate: the page is served over TLS.")
    ] = None,
    key: Annotated[Path | None, typer.Option(help="PEM key of --certificate.")] = None,
    give_up_s: Annotated[
        float | None,
        typer.Option(
            "--give-up",
            min=0.1,
            help="End with exit code 1 if no vehicle or router is reached in so many seconds; "
            "without it the page opens and says so.",
        ),
    ] = None,
) -> None:
    """Serve a page that shows every vehicle live."""
    from contextlib import suppress

    from service.ground.station import Station, StationSettings

    settings = StationSettings.checked(
        config=config,
        connect=connect or [],
        listen=listen or [],
        port=port,
        bind=bind,
        token=token,
        host_names=host_name or [],
        certificate=certificate,
        key=key,
    )
    with Station(settings) as station:
        if give_up_s is not None:
            station.await_peer(give_up_s)
        typer.echo(station.words)
        # uvicorn raises the signal again that ended it: here the Zenoh sessions are still to be closed.
        signal.signal(signal.SIGTERM, signal.default_int_handler)
        with suppress(KeyboardInterrupt):
            station.serve()
