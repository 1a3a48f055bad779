"""Where a viewer (`watch`, `ground`) looks for vehicles, and with which certificates."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from service.security.security import Security

DEFAULT_CONNECT = "tcp/127.0.0.1:7447"

ConnectOption = Annotated[
    list[str] | None,
    typer.Option(
        help="Zenoh endpoint of a vehicle or router; may be given many times. "
        f"Without any endpoint: {DEFAULT_CONNECT}."
    ),
]


@dataclass(frozen=True)
class ViewerEndpoints:
    """Of a viewer's Zenoh sessions.

    Args:
        connect: vehicles and routers to reach.
        listen: where vehicles connect.
        security: certificates and passwords; None: none of them.
    """

    connect: tuple[str, ...]
    listen: tuple[str, ...]
    security: Security | None


def viewer_endpoints(
    config: Path | None, connect: Sequence[str], listen: Sequence[str] = ()
) -> ViewerEndpoints:
    """What the command line says, else the file's `[zenoh]`, else a vehicle on this computer.

    Raises:
        ConfigError: an endpoint, a file or a certificate that cannot be used.
    """
    from service.security.options import load_zenoh_settings

    check_endpoints("--connect", connect)
    check_endpoints("--listen", listen)
    security = None
    if config is not None:
        settings = load_zenoh_settings(config)
        security = settings.security
        if not connect and not listen:
            connect = settings.connect
            # The default is for vehicles: a viewer listens only where its file says so.
            listen = settings.listen if "listen" in settings.model_fields_set else ()
    if not connect and not listen:
        connect = (DEFAULT_CONNECT,)
    return ViewerEndpoints(tuple(connect), tuple(listen), security)


def check_endpoints(option: str, endpoints: Sequence[str]) -> None:
    """Look at endpoints of the command line.

    Raises:
        ConfigError: one that is none; the text names the option.
    """
    from service.errors import ConfigError
    from service.settings.zenoh import check_endpoint

    for endpoint in endpoints:
        try:
            check_endpoint(endpoint)
        except ValueError as error:
            raise ConfigError(f"{option}: {error}") from error
