"""`uavdepth evaluate-flight`."""

from __future__ import annotations

import json
import sys
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from service.errors import ConfigError

if TYPE_CHECKING:
    from service.flight_evaluation.evaluation import Evaluation

_MOST_ROUNDS = 16
"""Three validation worlds each of a scene: their seeds, 950 to 999, end where those of tests begin."""


class DepthChoice(StrEnum):
    """Whose depth is flown with."""

    TRUE = "true"
    NETWORK = "network"
    BOTH = "both"


def evaluate_flight(
    depth: Annotated[
        DepthChoice, typer.Option(help="Exact depth, the network's, or both.")
    ] = DepthChoice.BOTH,
    model: Annotated[str, typer.Option(help="Network: a file, or the name of one that ships.")] = "default",
    scenes: Annotated[
        str | None, typer.Option(help="Scenes by name, separated by commas; all five if left out.")
    ] = None,
    quick: Annotated[bool, typer.Option("--quick", help="A minute or two: to see that it works.")] = False,
    approaches: Annotated[
        int | None,
        typer.Option(min=0, help="Approaches of all scenes together, each flown by both autopilots."),
    ] = None,
    corridors: Annotated[int | None, typer.Option(min=0, help="Corridors of all scenes together.")] = None,
    poses: Annotated[int | None, typer.Option(min=0, help="Random poses a scene, with exact depth.")] = None,
    rounds: Annotated[
        int,
        typer.Option(
            min=1, max=_MOST_ROUNDS, help="So many times as many poses, flights and turns, in other worlds."
        ),
    ] = 1,
    seed: Annotated[int, typer.Option(min=0, help="Of poses, flights and routes.")] = 1,
    latency_ms: Annotated[
        float, typer.Option(min=0.0, max=290.0, help="From exposure to the message's leaving.")
    ] = 100.0,
    sigma_factor: Annotated[
        float | None,
        typer.Option(min=0.0, max=5.0, help="As `[scan] sigma_factor`; its default if left out."),
    ] = None,
    validation: Annotated[
        bool, typer.Option("--validation", help="In worlds kept for choices instead of those of tests.")
    ] = False,
    plots: Annotated[Path | None, typer.Option(help="Folder for plots (needs matplotlib).")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Fly rendered worlds and hold what the autopilot is told against exact truth.

    Open part: random poses and flights at 1 to 6 m/s, turns and hovers, each scan judged element by element.
    Closed part: the service and a fake autopilot in stepped time, towards obstacles and along free ways.
    """
    from service.benchmark.machine import machine_name
    from service.flight_evaluation.evaluation import Evaluation
    from service.flight_evaluation.plan import EvaluationPlan
    from service.flight_evaluation.plan import quick as quickly
    from service.flight_evaluation.plots import draw, plots_are_possible
    from service.flight_evaluation.provenance import model_name, today
    from service.flight_evaluation.report import report
    from service.flight_evaluation.sight import DepthKind
    from service.flight_evaluation.tables import print_report
    from service.flight_evaluation.worlds import DEFAULT_SCENES, KNOWN_SCENES
    from service.log_setup import log_to_standard_error

    log_to_standard_error()
    names = DEFAULT_SCENES if scenes is None else tuple(name.strip() for name in scenes.split(","))
    for name in names:
        if name not in KNOWN_SCENES:
            raise ConfigError(f"--scenes: no scene is called {name!r}; there are {', '.join(KNOWN_SCENES)}")
    kinds = (DepthKind.TRUE, DepthKind.NETWORK) if depth is DepthChoice.BOTH else (DepthKind(depth.value),)
    plan = EvaluationPlan(
        scenes=tuple(dict.fromkeys(names)),
        kinds=kinds,
        model=model,
        latency_s=latency_ms / 1000.0,
        seed=seed,
        sigma_factor=sigma_factor,
        validation=validation,
    )
    plan = quickly(plan) if quick else plan
    plan = plan.repeated(rounds).changed(approaches=approaches, corridors=corridors, poses=poses)
    evaluation = Evaluation(plan)
    _run(evaluation)
    result = report(evaluation, machine_name(), today(), model_name(evaluation))
    if as_json:
        typer.echo(json.dumps(result))
    else:
        print_report(result)
    if plots is not None:
        if plots_are_possible():
            for path in draw(evaluation, plots):
                typer.echo(f"plot: {path}", err=True)
        else:
            typer.echo("no plots: matplotlib is not installed (pip install 'uavdepth[train]')", err=True)


def _run(evaluation: Evaluation) -> None:
    """Fly, with a bar for who watches; nothing but the result goes to standard output."""
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), disable=not sys.stderr.isatty(), transient=True) as progress:
        task = progress.add_task("flying", total=1.0)
        for step in evaluation.run():
            progress.update(task, description=step.text, advance=step.share)
