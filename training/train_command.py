"""`uavdepth train`: renders what is missing of the training frames, then trains."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from training.errors import CheckpointError, TrainingSettingsError
from training.extras import needs_extra

if TYPE_CHECKING:
    from training.data.batches import FramePool
    from training.settings import TrainingSettings
    from training.trainer import Trainer

CHECKPOINT_NAME = "checkpoint.pt"
LOG_NAME = "log.jsonl"
DEFAULT_MINUTES = 60.0
_SAVE_EVERY_S = 120.0


def train(
    data: Annotated[Path, typer.Option(help="Folder of rendered training frames.")] = Path("training_data"),
    output: Annotated[Path, typer.Option(help="Folder of the run: checkpoint and log.")] = Path(
        "training_run"
    ),
    render: Annotated[bool, typer.Option(help="Render what is missing of the frames first.")] = False,
    seeds: Annotated[int, typer.Option(min=1, max=900, help="How many worlds of each scene to render.")] = 60,
    first_seed: Annotated[int, typer.Option(min=0, max=899, help="Seed of the first of them.")] = 0,
    scenes: Annotated[str, typer.Option(help="Scenes to render, by commas.")] = (
        "city,suburb,farm,park,mountain,forest,wall"
    ),
    frames_per_seed: Annotated[int, typer.Option(min=1, help="Frames rendered of each world.")] = 24,
    thin_share: Annotated[
        float,
        typer.Option(min=0.0, max=1.0, help="Share of them taken right before poles, wires and trunks."),
    ] = 0.0,
    minutes: Annotated[
        float | None,
        typer.Option(help=f"Length of the run in minutes of training; {DEFAULT_MINUTES:g} if neither."),
    ] = None,
    images: Annotated[int | None, typer.Option(help="Length of the run in pictures shown.")] = None,
    init: Annotated[
        Path | None,
        typer.Option(
            help="Checkpoint of another run to start from, wherever its weights fit, or a network that flies "
            "(.onnx, not in 8 bits)."
        ),
    ] = None,
    fine_tune: Annotated[
        bool,
        typer.Option(
            help="With --init: lower rates, full size, half as many changed surfaces, nothing frozen."
        ),
    ] = False,
    resume: Annotated[bool, typer.Option(help="Go on from the checkpoint in the run's folder.")] = False,
    seed: Annotated[
        int | None, typer.Option(help="Seed of random weights and of the order of pictures; 0 if not given.")
    ] = None,
    thin_weight: Annotated[
        float | None,
        typer.Option(min=1.0, help="How often a pixel of poles, wires and twigs counts; 8 if not given."),
    ] = None,
    photos: Annotated[
        Path | None,
        typer.Option(help="Folder of photographs (PNG, JPEG) to lay on rendered surfaces now and then."),
    ] = None,
    precision: Annotated[str, typer.Option(help="auto, fp32 or bf16.")] = "auto",
    threads: Annotated[int | None, typer.Option(min=1, help="Threads; every core if not given.")] = None,
) -> None:
    """Train the depth network on rendered flights with exact depth.

    A run in minutes plans its learning rates by the clock, one in pictures is repeatable. Frames may be
    added to the folder while the run goes on. Worlds kept for validation and tests are refused. To go on
    exactly, a run with photographs is resumed with the same ones.
    """
    if init is not None and resume:
        raise TrainingSettingsError(f"--init {init} and --resume: a run goes on or starts, not both")
    if fine_tune and init is None:
        raise TrainingSettingsError("--fine-tune needs --init: a run on a trained network")
    settings = _settings_maker(minutes, images, seed, precision, fine_tune, thin_weight)
    if render:
        _render(data, scenes, range(first_seed, first_seed + seeds), frames_per_seed, thin_share)
    with needs_extra("train", "train"):
        import cv2
        import torch

    cv2.setNumThreads(1)
    if threads is not None:
        torch.set_num_threads(threads)
    trainer = _trainer(_pool(data, photos), output / CHECKPOINT_NAME, resume, settings)
    if init is not None:
        typer.echo(f"{init}: {trainer.start_from(init)} numbers taken over")
    _run(trainer, output)


def _render(data: Path, scenes: str, seeds: range, frames_per_seed: int, thin_share: float) -> None:
    with needs_extra("train", "sim"):
        from training.data.rendering import RenderPlan, render_plan
        from training.data.seed_split import SeedSplit

    names = tuple(name.strip() for name in scenes.split(",") if name.strip())
    plan = RenderPlan(
        data, names, SeedSplit.TRAIN, seeds.start, len(seeds), frames_per_seed, thin_share=thin_share
    )

    def tell(scene: str, seed: int, frames: int) -> None:
        typer.echo(f"rendered {frames} frames of {scene}:{seed}")

    def tell_left_out(scene: str, seed: int, reason: str) -> None:
        typer.echo(f"left out {scene}:{seed}: {reason}", err=True)

    render_plan(plan, tell, tell_left_out)


SettingsMaker = Callable[["TrainingSettings | None"], "TrainingSettings"]


def _settings_maker(
    minutes: float | None,
    images: int | None,
    seed: int | None,
    precision: str,
    fine_tune: bool = False,
    thin_weight: float | None = None,
) -> SettingsMaker:
    """How to get a run's settings, from those of its checkpoint if it goes on."""
    if minutes is not None and images is not None:
        raise TrainingSettingsError(f"--minutes {minutes:g} and --images {images}: a run has one length")

    def make(previous: TrainingSettings | None) -> TrainingSettings:
        from dataclasses import replace

        from training.settings import TrainingSettings, for_fine_tuning

        if previous is None:
            length = DEFAULT_MINUTES if minutes is None and images is None else minutes
            new = TrainingSettings(images=images, minutes=length, seed=seed or 0, precision=precision)
            if thin_weight is not None:
                new = replace(new, loss=replace(new.loss, thin=thin_weight))
            return for_fine_tuning(new) if fine_tune else new
        if seed is not None and seed != previous.seed:
            raise TrainingSettingsError(
                f"--seed is {seed}, but the run was started with {previous.seed}: other pictures would "
                "follow; leave it out, or start a new run with --output"
            )
        if thin_weight is not None and thin_weight != previous.loss.thin:
            raise TrainingSettingsError(
                f"--thin-weight is {thin_weight:g}, but the run was started with {previous.loss.thin:g}: it "
                "would be taught otherwise half way; leave it out, or start a new run with --output"
            )
        if minutes is None and images is None:
            return replace(previous, precision=precision)
        return replace(previous, images=images, minutes=minutes, precision=precision)

    return make


def _pool(data: Path, photos: Path | None) -> FramePool:
    from training.data.batches import FramePool
    from training.data.photo_textures import PhotoTextures

    return FramePool(data, photos=None if photos is None else PhotoTextures(photos))


def _trainer(pool: FramePool, checkpoint: Path, resume: bool, settings: SettingsMaker) -> Trainer:
    from training.checkpoint import Checkpoint
    from training.trainer import Trainer

    if resume:
        state = Checkpoint.load(checkpoint)
        return Trainer.resume(state, pool, settings(state.settings))
    if checkpoint.exists():
        raise TrainingSettingsError(
            f"{checkpoint} is there already: --resume goes on with it, --output names another folder"
        )
    return Trainer(settings(None), pool)


def _try_to_save(trainer: Trainer, path: Path) -> None:
    """Save on the way; a disk that is full now may have room later, so the run goes on."""
    try:
        trainer.save(path)
    except CheckpointError as error:
        typer.echo(str(error), err=True)


def _run(trainer: Trainer, output: Path) -> None:
    from training.run_log import RunLog

    log = RunLog(output / LOG_NAME)
    saved_s, images, before_s = trainer.trained_s, trainer.images, trainer.trained_s
    try:
        for report in trainer.run():
            step_s, before_s = report.trained_s - before_s, report.trained_s
            batch, images = report.images - images, report.images
            summary = log.add(report, batch, step_s, trainer.frames)
            if summary is not None:
                typer.echo(summary.line())
            if report.trained_s - saved_s > _SAVE_EVERY_S:
                saved_s = report.trained_s
                _try_to_save(trainer, output / CHECKPOINT_NAME)
    finally:
        trainer.save(output / CHECKPOINT_NAME)
    typer.echo(
        f"{output / CHECKPOINT_NAME}: {trainer.images} pictures in {trainer.trained_s / 60:.1f} minutes"
    )
