"""`uavdepth evaluate`.

Heavy packages are imported when the command runs, so that its help is fast.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from training.errors import EvaluationError
from training.extras import needs_extra

if TYPE_CHECKING:
    from training.evaluation_frames import EvaluationPlan
    from training.evaluation_report import EvaluationReport

_DEFAULT_SEEDS = "1000-1005"
_DEFAULT_FRAMES = 12
_DEFAULT_POINTS, _DEFAULT_KITTI_POINTS = "100", "20,100,200"
_TABLE_WIDTH = 140
STANDARD_OUTPUT = "-"


def evaluate(
    model: Annotated[str, typer.Argument(help="Network: a file, or the name of one that ships.")] = "default",
    scenes: Annotated[
        str | None, typer.Option(help="Scenes, by commas; all of them if not given.", show_default="all")
    ] = None,
    seeds: Annotated[
        str | None,
        typer.Option(
            help="Scene seeds from 1000 (tests) or 900 to 999 (validation), as 1000-1005,1010.",
            show_default=_DEFAULT_SEEDS,
        ),
    ] = None,
    frames_per_seed: Annotated[
        int | None, typer.Option(min=1, help="Frames of each world.", show_default=str(_DEFAULT_FRAMES))
    ] = None,
    data: Annotated[
        Path | None,
        typer.Option(help="Folder where rendered frames are kept: a broken-off run goes on there."),
    ] = None,
    other_surfaces: Annotated[
        bool,
        typer.Option(
            help="Lay patterns and filters on most pictures: what a network owes to the renderer's materials."
        ),
    ] = False,
    kitti: Annotated[
        Path | None,
        typer.Option(help="Measure on KITTI raw data in this folder instead: DATE/DRIVE/image_02/data."),
    ] = None,
    every: Annotated[int, typer.Option(min=1, help="With --kitti: one picture of so many.")] = 1,
    points: Annotated[
        str | None,
        typer.Option(
            help="How many point hints, by commas; each is a row of its own.",
            show_default=f"{_DEFAULT_POINTS}; with --kitti {_DEFAULT_KITTI_POINTS}",
        ),
    ] = None,
    provider: Annotated[str, typer.Option(help="What runs the network: auto, cpu, openvino, ...")] = "auto",
    threads: Annotated[int | None, typer.Option(min=1, help="Threads for inference.")] = None,
    precision: Annotated[str, typer.Option(help="auto, float, or int8 for the 8-bit file.")] = "auto",
    as_json: Annotated[
        str | None, typer.Option("--json", help="File for the result as one JSON object; - prints it.")
    ] = None,
    sheet: Annotated[
        Path | None, typer.Option(help="PNG to write: camera, truth, network, error and sigma.")
    ] = None,
) -> None:
    """Measure a depth network's errors on rendered worlds, or on real pictures, that it was not trained on.

    The network is measured with every hint that it takes: none; the ground, from attitude and height as
    wrong as in flight; and points of known depth besides. All seven metrics, median-scaled and in metres,
    by distance, sigma against the error, and the nearest obstacle of each 5 degree element, beside
    baselines that never look at the picture. Kinds of scene that training never had are reported apart.
    """
    with needs_extra("evaluate", "sim"):
        from training.evaluation_run import evaluate_kitti, evaluate_rendered
        from training.evaluation_sheet import write_sheet
        from uavdepth.model.depth_model import DepthModel

    counts = parse_points(points or (_DEFAULT_POINTS if kitti is None else _DEFAULT_KITTI_POINTS))
    if kitti is None:
        plan = _plan(scenes, seeds, frames_per_seed, data, other_surfaces)
        network = DepthModel.load(model, provider, threads, precision=precision)
        result = evaluate_rendered(network, plan, counts)
    else:
        if other_surfaces or any(option is not None for option in (scenes, seeds, frames_per_seed, data)):
            raise EvaluationError("--kitti has no scenes, seeds or rendered frames: give one or the other")
        network = DepthModel.load(model, provider, threads, precision=precision)
        result = evaluate_kitti(network, kitti, counts, every)
    if sheet is not None:
        write_sheet(sheet, result.rows)
    if as_json is not None:
        _write_json(as_json, result.report)
    if as_json != STANDARD_OUTPUT:
        _print_tables(result.report)


def parse_points(text: str) -> tuple[int, ...]:
    """Counts of a text such as "20,100,200". Raises EvaluationError."""
    parts = [part.strip() for part in text.split(",")]
    if not all(part.isascii() and part.isdigit() for part in parts):
        raise EvaluationError(f"points are {text!r}: whole numbers by commas are needed, as 20,100,200")
    return tuple(int(part) for part in parts)


def _plan(
    scenes: str | None,
    seeds: str | None,
    frames_per_seed: int | None,
    data: Path | None,
    other_surfaces: bool,
) -> EvaluationPlan:
    from training.evaluation_frames import EvaluationPlan, parse_seeds
    from uavdepth.scenes import SCENE_NAMES

    names = SCENE_NAMES if scenes is None else [name.strip() for name in scenes.split(",") if name.strip()]
    return EvaluationPlan(
        tuple(names),
        parse_seeds(seeds or _DEFAULT_SEEDS),
        frames_per_seed or _DEFAULT_FRAMES,
        data,
        other_surfaces,
    )


def _write_json(target: str, report: EvaluationReport) -> None:
    text = json.dumps(report.as_json(), indent=2)
    if target == STANDARD_OUTPUT:
        typer.echo(text)
        return
    try:
        Path(target).parent.mkdir(parents=True, exist_ok=True)
        Path(target).write_text(text + "\n", encoding="utf-8")
    except OSError as error:
        raise EvaluationError(f"cannot write the result {target}: {error.strerror}") from error


def _print_tables(report: EvaluationReport) -> None:
    from rich.console import Console

    from training.evaluation_tables import tables

    console = Console(width=None if sys.stdout.isatty() else _TABLE_WIDTH)
    what = f"{report.model} on {report.provider} in {report.precision}"
    console.print(f"{what}: {report.data}", highlight=False)
    for table in tables(report):
        console.print(table)
    for name in report.skipped:
        console.print(f"skipped: {name}", highlight=False, markup=False)
    if report.note:
        console.print(report.note, highlight=False)
