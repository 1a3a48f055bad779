"""Options that commands share which speak with an autopilot."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

ConfigOption = Annotated[
    Path | None, typer.Option("--config", "-c", help="TOML file; see `uavdepth config example`.")
]
AutopilotOption = Annotated[
    str | None, typer.Option(help="Endpoint in place of the configured one, e.g. tcp:127.0.0.1:5760.")
]
OverridesOption = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="SECTION.KEY=VALUE", help="Any other key; may be given many times."),
]
