"""One network's run from nothing to its result; what is there already is not made again."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from datetime import UTC, datetime
from itertools import chain
from pathlib import Path

import torch
from lightning_fabric import Fabric
from torch import Tensor

from training.comparison.plan import HEIGHT, SCENES, START_FILE, START_IMAGES, WIDTH, run_settings
from training.comparison.result import ComparisonResult
from training.data.flight_sets import COMPARISON_SETS, write_flight_set
from training.encoder_distillation import EncoderDistillation
from training.errors import CheckpointError
from training.evaluation_report import machine_text
from training.networks.counting import count_multiply_adds, count_parameters
from training.selfsupervised import command
from training.selfsupervised.frames import open_triplets
from training.selfsupervised.run_state import RunState
from training.selfsupervised.trained_network import trained_network
from training.selfsupervised.trainer import SelfSupervisedTrainer
from training.sequence_evaluation import evaluate_disparity_network
from training.sequences.airsim import open_airsim
from training.sequences.triplet_loader import LoaderSettings, TripletLoader

Say = Callable[[str], None]
_SAY_EVERY_IMAGES = 1000
_START_BATCH = 16


def render_sets(data: Path, say: Say) -> None:
    """Render what is missing of the four sets."""
    for name, wanted in COMPARISON_SETS.items():
        write_flight_set(data / name, wanted, lambda folder, frames: say(f"rendered {frames} of {folder}"))


def make_start(data: Path, say: Say) -> Path:
    """The encoder weights that every network starts from, taught on the training pictures."""
    path = data / START_FILE
    if path.exists():
        return path
    triplets = open_triplets(run_settings("monodepth2", data).sources)
    settings = LoaderSettings(WIDTH, HEIGHT, _START_BATCH)
    loader = TripletLoader(triplets, settings, data / "cache")
    lesson = EncoderDistillation(START_IMAGES)
    for step in lesson.run(_pictures(loader)):
        if step.images % _SAY_EVERY_IMAGES < _START_BATCH:
            say(f"encoder: {step.images}/{START_IMAGES} pictures, error {step.error:.3f}")
    lesson.save(path)
    return path


def _pictures(loader: TripletLoader) -> Iterator[Tensor]:
    """Targets and, for as many other pictures, the frames before them."""
    return chain.from_iterable(
        (batch.target_jittered, batch.sources_jittered[0]) for batch in loader.stream()
    )


def train_run(network: str, data: Path, folder: Path) -> None:
    """Train to the end, from the checkpoint in the run's folder if there is one."""
    settings = run_settings(network, data)
    trainer = SelfSupervisedTrainer(settings, open_triplets(settings.sources), one_process())
    checkpoint = folder / command.CHECKPOINT_NAME
    command.start(trainer, checkpoint, resume=checkpoint.exists())
    command.train(trainer, folder)


def one_process() -> Fabric:
    """Single precision on this process's CPU: results must not depend on what else a machine has."""
    fabric = Fabric(accelerator="cpu", devices=1, precision="32-true")
    fabric.launch()
    return fabric


def measure_run(folder: Path, data: Path) -> ComparisonResult:
    """Measure a finished run on all test pictures.

    Raises:
        CheckpointError: no checkpoint, a broken one, or one of a run that is not finished.
        TrainingDataError: test sets that cannot be read.
    """
    checkpoint = folder / command.CHECKPOINT_NAME
    state = RunState.load(checkpoint)
    settings = state.settings
    if state.images < settings.image_steps:
        raise CheckpointError(
            f"{checkpoint} stands at {state.images} of {settings.image_steps} pictures: it is not finished"
        )
    network = trained_network(state)
    scenes = {
        scene: evaluate_disparity_network(
            network,
            open_airsim(data / f"{scene}-test"),
            settings.width,
            settings.height,
            min_depth_m=settings.loss.min_depth_m,
            max_depth_m=settings.loss.max_depth_m,
        ).as_json()
        for scene in SCENES
    }
    picture = torch.zeros(1, 3, settings.height, settings.width)
    kept = settings.model_dump(mode="json", exclude={"sources", "cache"})
    kept["network"].pop("encoder_weights")
    return ComparisonResult(
        network=settings.network.name,
        parameters=count_parameters(network),
        multiply_adds=count_multiply_adds(network, picture),
        settings=kept,
        images=state.images,
        trained_minutes=round(state.trained_s / 60, 1),
        machine=f"{machine_text()}, PyTorch {torch.__version__}",
        date=datetime.now(UTC).isoformat(timespec="minutes"),
        scenes=scenes,
    )
