"""`uavdepth fly-record`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from service.errors import ConfigError


def fly_record(
    names: Annotated[list[str] | None, typer.Argument(help="Which flights; all of them otherwise.")] = None,
    logs: Annotated[Path, typer.Option(help="Folder of the simulator's logs.")] = Path("sitl_logs"),
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder of the records.")] = Path(
        "sitl_logs/flights"
    ),
    force: Annotated[bool, typer.Option("--force", help="Replace records that are there.")] = False,
) -> None:
    """Make the flights that the tests replay: true paths of simulated flights through rendered worlds.

    Golden scans are made by `uavdepth replay FOLDER --update`.
    """
    from service.replay.flight_plans import FLIGHT_PLANS
    from service.replay.fly_record import fly_record as fly

    plans = {plan.name: plan for plan in FLIGHT_PLANS}
    unknown = [name for name in names or () if name not in plans]
    if unknown:
        raise ConfigError(f"fly-record: no flight is called {unknown[0]!r}; there are {', '.join(plans)}")
    if not logs.is_dir():
        raise ConfigError(f"fly-record: --logs {logs}: no such folder")
    for name in names or plans:
        path = fly(plans[name], logs, output, force=force)
        typer.echo(f"{path}: {plans[name].title}, {path.stat().st_size / 1e6:.1f} MB")
