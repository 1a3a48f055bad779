"""`uavdepth train-video`: the paper's method on frames of any camera that moves."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from training.extras import needs_extra

if TYPE_CHECKING:
    from lightning_fabric import Fabric

    from training.selfsupervised.settings import SelfSupervisedSettings
    from training.selfsupervised.trainer import SelfSupervisedTrainer
    from training.sequences.triplets import TripletSet

CHECKPOINT_NAME = "checkpoint.pt"
BOARD_NAME = "tensorboard"
_SAVE_EVERY_S = 120.0


def train_video(
    config: Annotated[Path, typer.Argument(help="TOML file of the run.")],
    output: Annotated[Path, typer.Option(help="Folder of the run: checkpoint, TensorBoard, cache.")] = Path(
        "video_run"
    ),
    resume: Annotated[bool, typer.Option(help="Go on from the checkpoint in the run's folder.")] = False,
    encoder_weights: Annotated[
        Path | None, typer.Option(help="ResNet-18 weights in torchvision's format to start from.")
    ] = None,
    threads: Annotated[int | None, typer.Option(min=1, help="Threads of each process; all if none.")] = None,
    precision: Annotated[str | None, typer.Option(help="auto, fp32 or bf16; the file's if none.")] = None,
) -> None:
    """Train depth and pose from video by re-projection, as Wei, Ding and Li 2025 do.

    On several processes or machines, start it by PyTorch's launcher:
    torchrun --nproc-per-node 2 -m service train-video run.toml
    """
    with needs_extra("train-video", "train"):
        import cv2
        import torch

        import training.selfsupervised.trainer as trainer_module
        from training.selfsupervised.settings import load_settings

    cv2.setNumThreads(1)
    if threads is not None:
        torch.set_num_threads(threads)
    settings = with_choices(load_settings(config), encoder_weights, precision)
    fabric = launch(settings)
    triplets = open_triplets(settings, quiet=fabric.global_rank > 0)
    trainer = trainer_module.SelfSupervisedTrainer(settings, triplets, fabric)
    start(trainer, output / CHECKPOINT_NAME, resume=resume)
    train(trainer, output, leads=fabric.is_global_zero)


def with_choices(
    settings: SelfSupervisedSettings, encoder_weights: Path | None, precision: str | None
) -> SelfSupervisedSettings:
    """The file's settings with what the command line says instead."""
    from training.selfsupervised.settings import parse_settings

    table = settings.model_dump(mode="json")
    if encoder_weights is not None:
        table["network"]["encoder_weights"] = str(encoder_weights)
    if precision is not None:
        table["precision"] = precision
    return parse_settings(table, "the command line")


def launch(settings: SelfSupervisedSettings) -> Fabric:
    """Fabric on what there is: the processes that PyTorch's launcher started, else this one alone."""
    from lightning_fabric import Fabric

    from training.precision import resolve_precision

    processes = int(os.environ.get("WORLD_SIZE", "1"))
    on_this_machine = int(os.environ.get("LOCAL_WORLD_SIZE", "1"))
    fabric = Fabric(
        accelerator="auto",
        devices=on_this_machine,
        num_nodes=max(processes // on_this_machine, 1),
        strategy="ddp" if processes > 1 else "auto",
        precision="bf16-mixed" if resolve_precision(settings.precision) == "bf16" else "32-true",
    )
    fabric.launch()
    return fabric


def open_triplets(settings: SelfSupervisedSettings, *, quiet: bool = False) -> TripletSet:
    """The frames of a run; what cannot be read is named and counted on standard error."""
    from training.selfsupervised import frames

    triplets = frames.open_triplets(settings.sources)
    if not quiet:
        for file, reason in triplets.skipped[:20]:
            typer.echo(f"skipped {file}: {reason}", err=True)
        typer.echo(f"{len(triplets.triplets)} frames, {len(triplets.skipped)} skipped", err=True)
    return triplets


def start(trainer: SelfSupervisedTrainer, checkpoint: Path, *, resume: bool) -> None:
    """Go on from a checkpoint, or make sure that none is overwritten.

    Raises:
        TrainingSettingsError: a new run where an old one lies.
        CheckpointError: a checkpoint that is missing, broken or of another run.
    """
    from training.errors import TrainingSettingsError
    from training.selfsupervised.run_state import RunState

    if resume:
        trainer.resume(RunState.load(checkpoint))
    elif checkpoint.exists():
        raise TrainingSettingsError(
            f"{checkpoint} is there already: --resume goes on with it, --output names another folder"
        )


def train(trainer: SelfSupervisedTrainer, output: Path, *, leads: bool = True) -> None:
    """Train to the end, saving on the way.

    Args:
        trainer: ready to go.
        output: folder of the run.
        leads: whether this process is the one that writes and speaks.
    """
    if not leads:
        for _ in trainer.run():
            pass
        return
    from training.selfsupervised.run_board import RunBoard
    from training.selfsupervised.run_progress import RunProgress

    checkpoint = output / CHECKPOINT_NAME
    saved_s = trainer.trained_s
    with RunBoard(output / BOARD_NAME) as board, RunProgress(trainer.settings, sys.stderr) as progress:
        try:
            for report in trainer.run():
                board.add(report)
                progress.add(report)
                if report.trained_s - saved_s > _SAVE_EVERY_S:
                    trainer.state().save(checkpoint)
                    saved_s = report.trained_s
        finally:
            trainer.state().save(checkpoint)
    typer.echo(f"{checkpoint}: {trainer.images} pictures in {trainer.trained_s / 60:.1f} minutes")
