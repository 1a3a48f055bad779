"""`uavdepth train`, `uavdepth evaluate` and `uavdepth export`.

Heavy packages are imported when a command runs, so that its help is fast.
"""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Annotated

import typer

from training.errors import ExportError
from training.evaluation_command import evaluate
from training.extras import needs_extra
from training.train_command import train

if TYPE_CHECKING:
    from training.checkpoint import Checkpoint
    from training.doubt_calibration import DoubtCalibration
    from uavdepth.model.card import ModelCard

__all__ = ["evaluate", "export", "train"]

DEFAULT_CHECKPOINT = Path("training_run/checkpoint.pt")
DEFAULT_NAME = "lite0-fan-eca"
_CALIBRATION_SEEDS = "900-903"
_CALIBRATION_FRAMES = 12


def export(
    output: Annotated[Path, typer.Argument(help="ONNX file to write.")],
    checkpoint: Annotated[
        Path, typer.Option(help="Checkpoint of `uavdepth train` or of `uavdepth train-video`.")
    ] = DEFAULT_CHECKPOINT,
    name: Annotated[str, typer.Option(help="Name of the network, for status and records.")] = DEFAULT_NAME,
    size: Annotated[
        str | None, typer.Option(help="Input as WIDTHxHEIGHT; that of the run's last phase if not given.")
    ] = None,
    further_data: Annotated[
        str,
        typer.Option(help="What else it learnt from than its frames, with licences, for the card."),
    ] = "",
    calibrate: Annotated[
        Path | None,
        typer.Option(
            help="Calibrate sigma on worlds of validation seeds; their frames are kept in this folder."
        ),
    ] = None,
    calibration_seeds: Annotated[
        str, typer.Option(help="Seeds of those worlds, 900 to 999.")
    ] = _CALIBRATION_SEEDS,
) -> None:
    """Write a trained network as ONNX with its card.

    The file is checked against PyTorch before it takes its place. A network that video has taught becomes a
    relative one: the service finds its metres.
    """
    with needs_extra("export", "train"):
        from training.checkpoint import Checkpoint, is_checkpoint_of
        from training.export import export_checkpoint
        from training.selfsupervised.run_state import FORMAT as FROM_VIDEO

    wanted = _parsed_size(size)
    if is_checkpoint_of(checkpoint, FROM_VIDEO):
        if calibrate is not None or further_data:
            raise ExportError(
                f"{checkpoint} is of train-video: --calibrate and --further-data are not for it"
            )
        _tell(_export_video(checkpoint, output, name, wanted), output)
        return
    run = Checkpoint.load(checkpoint)
    measured, factor = {}, 1.0
    if calibrate is not None:
        found = _calibrated(run, wanted, name, calibrate, calibration_seeds)
        measured["sigma_calibration"], factor = found.as_json(), found.factor
        typer.echo(f"sigma is multiplied by {factor:.3f}, from {found.frames} frames of {found.data}")
    _tell(export_checkpoint(run, output, name, measured, wanted, factor, further_data), output)


def _export_video(checkpoint: Path, output: Path, name: str, size: tuple[int, int] | None) -> ModelCard:
    from training.selfsupervised.export import export_run
    from training.selfsupervised.run_state import RunState

    state = RunState.load(checkpoint)
    return export_run(state, output, state.settings.network.name if name == DEFAULT_NAME else name, size)


def _tell(card: ModelCard, output: Path) -> None:
    typer.echo(
        f"{output}: {card.name}, {card.input_width}x{card.input_height}, "
        f"{output.stat().st_size / 1e6:.1f} MB, checked against PyTorch"
    )


def _calibrated(
    run: Checkpoint, size: tuple[int, int] | None, name: str, store: Path, seeds: str
) -> DoubtCalibration:
    """Sigma's calibration of the network as it will fly."""
    with needs_extra("export --calibrate", "sim"):
        from training.doubt_calibration import calibrate_doubt
        from training.evaluation_frames import EvaluationPlan, parse_seeds
        from training.export import export_checkpoint
        from uavdepth.model.depth_model import DepthModel
        from uavdepth.scenes import HELD_OUT_SCENES, SCENE_NAMES

    scenes = tuple(scene for scene in SCENE_NAMES if scene not in HELD_OUT_SCENES)
    plan = EvaluationPlan(scenes, parse_seeds(seeds), _CALIBRATION_FRAMES, store)
    with TemporaryDirectory() as folder:
        path = Path(folder) / "uncalibrated.onnx"
        export_checkpoint(run, path, name, size=size)
        return calibrate_doubt(DepthModel.load(str(path), "cpu"), plan)


def _parsed_size(text: str | None) -> tuple[int, int] | None:
    """(640, 320) of "640x320". Raises ExportError."""
    if text is None:
        return None
    width, _, height = text.lower().partition("x")
    if not all(side.isascii() and side.isdigit() for side in (width, height)):
        raise ExportError(f"size is {text!r}: WIDTHxHEIGHT is needed, as 640x320")
    return int(width), int(height)
