"""`uavdepth train`, `uavdepth evaluate` and `uavdepth export`.

Heavy packages are imported when a command runs, so that its help is fast and `evaluate` needs no torch.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from training.errors import EvaluationError
from training.extras import needs_extra
from training.train_command import train

if TYPE_CHECKING:
    from training.evaluation_frames import EvaluationFrame, EvaluationPlan
    from training.evaluation_report import EvaluationReport
    from training.evaluation_sheet import SheetRow

__all__ = ["evaluate", "export", "train"]

DEFAULT_CHECKPOINT = Path("training_run/checkpoint.pt")
DEFAULT_NAME = "lite0-fan-eca"

_SHEET_ROWS = 24


def evaluate(
    model: Annotated[str, typer.Argument(help="Network: a file, or the name of one that ships.")] = "default",
    scenes: Annotated[str, typer.Option(help="Scenes, by commas.")] = "city,mountain,forest,wall",
    seeds: Annotated[
        str, typer.Option(help="Scene seeds from 1000 (tests) or 900 to 999 (validation): 1000-1005,1010.")
    ] = "1000-1005",
    frames_per_seed: Annotated[int, typer.Option(min=1, help="Frames of each world.")] = 12,
    data: Annotated[
        Path | None,
        typer.Option(help="Folder where rendered frames are kept for the next time."),
    ] = None,
    provider: Annotated[str, typer.Option(help="auto, cpu or openvino.")] = "auto",
    threads: Annotated[int | None, typer.Option(min=1, help="Threads for inference.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the result as one JSON object.")] = False,
    sheet: Annotated[
        Path | None, typer.Option(help="PNG to write: camera, truth and network side by side.")
    ] = None,
) -> None:
    """Measure a depth network's errors on rendered worlds that it was not trained on.

    All seven metrics, median-scaled and in metres, beside two baselines that never look at the picture:
    a constant depth, and flat ground from attitude and height.
    """
    with needs_extra("evaluate", "sim"):
        from training.evaluation_frames import EvaluationPlan

    names = tuple(name.strip() for name in scenes.split(",") if name.strip())
    plan = EvaluationPlan(names, parse_seeds(seeds), frames_per_seed, data)
    report, rows = _evaluate(plan, model, provider, threads, with_sheet=sheet is not None)
    if sheet is not None:
        from training.evaluation_sheet import write_sheet

        write_sheet(sheet, rows, columns=2)
    if as_json:
        typer.echo(json.dumps(report.as_json(), indent=2))
        return
    from rich.console import Console

    console = Console(width=None if sys.stdout.isatty() else 120)
    for table in report.tables():
        console.print(table)


def parse_seeds(text: str) -> tuple[int, ...]:
    """Seeds of a text such as "1000-1005,1010". Raises EvaluationError."""
    seeds: list[int] = []
    for part in text.split(","):
        first, dash, last = part.strip().partition("-")
        numbers = [first, last] if dash else [first]
        if not all(number.isascii() and number.isdigit() for number in numbers):
            raise EvaluationError(
                f"seeds are {text!r}: whole numbers and ranges are needed, as 1000-1005,1010"
            )
        low, high = int(first), int(numbers[-1])
        if not low <= high <= low + 10_000:
            raise EvaluationError(f"seeds {part.strip()!r} are not a rising range of at most 10000")
        seeds.extend(range(low, high + 1))
    return tuple(dict.fromkeys(seeds))


def export(
    output: Annotated[Path, typer.Argument(help="ONNX file to write.")],
    checkpoint: Annotated[Path, typer.Option(help="Checkpoint of `uavdepth train`.")] = DEFAULT_CHECKPOINT,
    name: Annotated[str, typer.Option(help="Name of the network, for status and records.")] = DEFAULT_NAME,
    measured: Annotated[
        Path | None,
        typer.Option(help="Result of `uavdepth evaluate --json` whose errors go into the card."),
    ] = None,
) -> None:
    """Write a trained network as ONNX with its card.

    The file is checked against PyTorch before it takes its place.
    """
    with needs_extra("export", "train"):
        from training.checkpoint import Checkpoint
        from training.export import export_checkpoint

    errors = _measured_errors(measured) if measured is not None else {}
    card = export_checkpoint(Checkpoint.load(checkpoint), output, name, errors)
    typer.echo(
        f"{output}: {card.name}, {card.input_width}x{card.input_height}, "
        f"{output.stat().st_size / 1e6:.1f} MB, checked against PyTorch"
    )


def _evaluate(
    plan: EvaluationPlan, model: str, provider: str, threads: int | None, *, with_sheet: bool
) -> tuple[EvaluationReport, list[SheetRow]]:
    from datetime import UTC, datetime

    from training.evaluation import measure_frame, sheet_row
    from training.evaluation_report import EvaluationReport
    from uavdepth.depth_model import DepthModel

    network = DepthModel.load(model, provider, threads)
    shown = indices_for_sheet(plan) if with_sheet else set()
    errors, rows = [], []
    for number, item in enumerate(_with_progress(plan)):
        measured = measure_frame(network, item)
        errors.append(measured.errors)
        if number in shown:
            rows.append(sheet_row(item, measured))
    report = EvaluationReport(
        model=f"{network.card.name} ({Path(network.source).name}, {network.card.created})",
        provider=network.provider,
        split=plan.split,
        scenes=tuple(plan.scenes),
        seeds=tuple(plan.seeds),
        frames_per_seed=plan.frames_per_seed,
        errors=errors,
        date=datetime.now(UTC).isoformat(timespec="seconds"),
    )
    return report, rows


def indices_for_sheet(plan: EvaluationPlan) -> set[int]:
    """Numbers of frames of the plan, as many of each scene, spread over its worlds."""
    per_scene = plan.frames_count // len(plan.scenes)
    rows = min(max(_SHEET_ROWS // len(plan.scenes), 1), per_scene)
    chosen = set()
    for scene in range(len(plan.scenes)):
        for row in range(rows):
            world, frame = divmod(int((row + 0.5) * per_scene / rows), plan.frames_per_seed)
            chosen.add((world * len(plan.scenes) + scene) * plan.frames_per_seed + frame)
    return chosen


def _with_progress(plan: EvaluationPlan) -> Iterator[EvaluationFrame]:
    """The plan's frames, with a bar on standard error that leaves standard output to the result."""
    from rich.console import Console
    from rich.progress import track

    console = Console(stderr=True)
    yield from track(
        plan.frames(),
        total=plan.frames_count,
        description="measuring",
        console=console,
        disable=not console.is_terminal,
        transient=True,
    )


def _measured_errors(path: Path) -> dict[str, Any]:
    """The part of an evaluation that belongs into a model card."""
    try:
        result = json.loads(path.read_text(encoding="utf-8"))
        return dict(result["summary"])
    except FileNotFoundError as error:
        raise EvaluationError(f"no result of an evaluation at {path}") from error
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise EvaluationError(f"{path} is not a result of `uavdepth evaluate --json`: {error!r}") from error
