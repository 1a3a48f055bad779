"""`uavdepth evaluate-video`: measures what `uavdepth train-video` has learnt."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer
from numpy.typing import NDArray

from training.errors import EvaluationError
from training.extras import needs_extra

if TYPE_CHECKING:
    from training.sequence_evaluation import MeasuredSequence
    from training.sequences.kitti_raw import KittiDrive

_SHEET_ROWS = 12
_STANDARD_OUTPUT = "-"


def evaluate_video(
    checkpoint: Annotated[Path, typer.Argument(help="Checkpoint of `uavdepth train-video`.")],
    kind: Annotated[str, typer.Argument(help="Layout of the data: kitti-raw, airsim or tartanair.")],
    path: Annotated[Path, typer.Argument(help="Folder of the data, with depth.")],
    split: Annotated[
        Path | None, typer.Option(help="With kitti-raw: file of the frames to measure, such as Eigen's.")
    ] = None,
    every: Annotated[int, typer.Option(min=1, help="Take one picture of so many.")] = 1,
    as_json: Annotated[
        str | None, typer.Option("--json", help="File for the result as one JSON object; - prints it.")
    ] = None,
    sheet: Annotated[
        Path | None, typer.Option(help="PNG to write: camera, truth, network and error.")
    ] = None,
    threads: Annotated[int | None, typer.Option(min=1, help="Threads; all if not given.")] = None,
) -> None:
    """Measure a network that learnt from video: the seven metrics, median-scaled and as given.

    Depth counts up to 80 m at the truth's own size; KITTI inside Garg's crop, as its tables have it.
    """
    with needs_extra("evaluate-video", "train"):
        import torch

        from training.evaluation_sheet import write_sheet
        from training.selfsupervised.run_state import RunState
        from training.selfsupervised.trained_network import trained_network
        from training.sequence_evaluation import evaluate_disparity_network
        from training.sequences.garg_crop import garg_mask

    if threads is not None:
        torch.set_num_threads(threads)
    state = RunState.load(checkpoint)
    settings = state.settings
    report = evaluate_disparity_network(
        trained_network(state),
        measured_sequences(kind, path, split),
        settings.width,
        settings.height,
        every,
        min_depth_m=settings.loss.min_depth_m,
        max_depth_m=settings.loss.max_depth_m,
        mask=garg_mask if kind == "kitti-raw" else None,
        sheet_rows=_SHEET_ROWS if sheet is not None else 0,
    )
    result = {"network": settings.network.name, "images": state.images, **report.as_json()}
    _tell(result, as_json)
    if sheet is not None:
        write_sheet(sheet, report.rows)


@dataclass(frozen=True)
class ChosenFrames:
    """Those frames of KITTI drives that a split names, as one sequence."""

    name: str
    frames: Sequence[tuple[KittiDrive, int]]

    def __len__(self) -> int:
        return len(self.frames)

    def image_bgr(self, index: int) -> NDArray[np.uint8]:
        """(H, W, 3) picture."""
        drive, number = self.frames[index]
        return drive.image_bgr(number)

    def truth_m(self, index: int) -> NDArray[np.float32] | None:
        """(H, W) z-depth."""
        drive, number = self.frames[index]
        return drive.truth_m(number)


def measured_sequences(kind: str, path: Path, split: Path | None) -> Sequence[MeasuredSequence]:
    """The data of a place, or the frames of it that a split file names.

    Raises:
        EvaluationError: a split for data other than KITTI raw.
        TrainingDataError: data or split that are missing or broken.
    """
    from training.sequences.kitti_raw import open_kitti_raw
    from training.sequences.opening import open_sequences
    from training.sequences.split_file import read_split, split_frames

    if split is None:
        return open_sequences(kind, path)
    if kind != "kitti-raw":
        raise EvaluationError(f"split files are for kitti-raw, not for {kind}")
    return [ChosenFrames(split.stem, split_frames(open_kitti_raw(path), read_split(split)).frames)]


def _tell(result: dict[str, Any], as_json: str | None) -> None:
    text = json.dumps(result, indent=2)
    if as_json == _STANDARD_OUTPUT:
        typer.echo(text)
        return
    if as_json is not None:
        try:
            Path(as_json).write_text(text + "\n", encoding="utf-8")
        except OSError as error:
            raise EvaluationError(f"cannot write the result {as_json}: {error.strerror}") from error
    from rich.console import Console
    from rich.table import Table

    scaled = result["median_scaled"]
    table = Table("depth from", *scaled, title=f"{result['network']}, {result['pictures']} pictures")
    rows = {
        f"{result['network']}, median-scaled": scaled,
        "constant depth, median-scaled": result["constant_depth_median_scaled"],
        f"{result['network']}, as given": result["unscaled"],
    }
    for name, values in rows.items():
        table.add_row(name, *(f"{value:.3f}" for value in values.values()))
    Console(width=140).print(table)
    for where, reason in result["skipped"]:
        typer.echo(f"skipped {where}: {reason}", err=True)
