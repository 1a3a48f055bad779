"""`uavdepth evaluate-motion`."""

from __future__ import annotations

import json
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated

import typer

from service.errors import ConfigError

RECORDED = Path("sitl_logs/C_s_turns.BIN")
PIPED_WIDTH = 140


def evaluate_motion(
    model: Annotated[
        str, typer.Option(help="Network: a file, the name of one that ships, or none.")
    ] = "default",
    flights: Annotated[bool, typer.Option(help="Fly through rendered worlds.")] = True,
    log: Annotated[
        Path | None,
        typer.Option(
            help=f"Recorded flight to replay through rendered worlds: NAME.BIN with NAME.tlog beside it. "
            f"Without it {RECORDED} is taken where it is there."
        ),
    ] = None,
    kitti: Annotated[
        list[Path] | None, typer.Option(help="Folder of KITTI raw or odometry data; may be given again.")
    ] = None,
    recorded: Annotated[bool, typer.Option(help="Replay the recorded flight.")] = True,
    seconds: Annotated[float, typer.Option(min=1.0, max=60.0, help="Length of each flight, seconds.")] = 6.0,
    rate: Annotated[
        float, typer.Option(min=5.0, max=30.0, help="Pictures a second of flights, not of records.")
    ] = 10.0,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
    strict: Annotated[bool, typer.Option("--strict", help="Exit code 1 where a target is missed.")] = False,
) -> None:
    """Measure metres from motion: points, network with live hints, scale of networks without metres."""
    from service.benchmark.machine import machine_name
    from service.motion_evaluation.evaluation import Errors, evaluate_journey
    from service.motion_evaluation.plan import planned_journeys
    from service.motion_evaluation.report import report_json, report_table
    from service.motion_evaluation.summary import GroupSummary, targets

    if log is None and RECORDED.is_file():
        log = RECORDED
    journeys = planned_journeys(flights, log if recorded else None, kitti or [], seconds, rate)
    if not journeys:
        raise ConfigError("nothing to evaluate: give --flights, --log FILE or --kitti FOLDER")
    network = None
    if model != "none":
        from uavdepth.model.depth_model import DepthModel

        network = DepthModel.load(model)
    groups, rows = dict[str, Errors](), dict[str, GroupSummary]()
    for journey in journeys:
        typer.echo(f"{journey.group}: {journey.name}", err=True)
        errors = evaluate_journey(journey, network)
        rows[journey.name] = GroupSummary.of(errors)
        groups.setdefault(journey.group, Errors()).join(errors)
    summaries = {name: GroupSummary.of(errors) for name, errors in groups.items()}
    wanted = targets(summaries)
    if as_json:
        about = {
            "machine": machine_name(),
            "date": datetime.now(UTC).date().isoformat(),
            "model": None if network is None else network.card.name,
            "provider": None if network is None else network.provider,
            "precision": None if network is None else network.precision,
            "hints": [] if network is None else list(network.card.hints),
            "seconds": seconds,
            "pictures_per_s": rate,
        }
        typer.echo(json.dumps(report_json(about, summaries, rows, wanted)))
    else:
        from rich.console import Console

        console = Console()
        width = console.width if console.is_terminal else PIPED_WIDTH
        Console(width=width).print(report_table(summaries, rows, wanted))
    if strict and not all(target.met for target in wanted):
        raise typer.Exit(1)
