"""`uavdepth run`."""

from __future__ import annotations

import signal
import threading
from pathlib import Path
from typing import Annotated

import typer

from service.options import AutopilotOption, ConfigOption, OverridesOption

_POLL_S = 0.1


def run(
    config: ConfigOption = None,
    camera: Annotated[
        str | None, typer.Option(help="Camera in place of the configured one, e.g. 0 or sim:city:3.")
    ] = None,
    autopilot: AutopilotOption = None,
    record: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Record the flight into this folder.")
    ] = None,
    overrides: OverridesOption = None,
) -> None:
    """Fly: camera to depth to OBSTACLE_DISTANCE and Zenoh, until interrupted."""
    stop = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda _number, _frame: stop.set())
    from service.log_setup import set_up_logging
    from service.settings.load import load_settings

    given = list(overrides or ())
    if camera is not None:
        given.append(f"camera.source={camera}")
    if autopilot is not None:
        given.append(f"autopilot.endpoint={autopilot}")
    if record is not None:
        given += [f"record.folder={record}", "record.enabled=true"]
    settings = load_settings(config, given)
    set_up_logging(settings.log)

    from service.run import Service

    service = Service(settings)
    try:
        service.start()
        while not stop.wait(_POLL_S):
            if service.failure is not None:
                raise service.failure
            if service.ended:
                typer.echo("The pictures are over.", err=True)
                break
    finally:
        service.stop()
