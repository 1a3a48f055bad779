"""`uavdepth record`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from service.options import AutopilotOption, ConfigOption, OverridesOption


def record(
    folder: Annotated[
        Path | None, typer.Argument(help="Where the record goes; \\[record] folder otherwise.")
    ] = None,
    config: ConfigOption = None,
    camera: Annotated[
        str | None, typer.Option(help="Camera in place of the configured one, e.g. 0 or sim:city:3.")
    ] = None,
    autopilot: AutopilotOption = None,
    overrides: OverridesOption = None,
) -> None:
    """Fly as `uavdepth run` does, and record the flight."""
    from service.run_command import run

    given = ["record.enabled=true", *(overrides or ())]
    run(config=config, camera=camera, autopilot=autopilot, record=folder, overrides=given)
