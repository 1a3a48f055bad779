"""Training runs of seconds."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from frames import make_store

from training.checkpoint import Checkpoint
from training.data.batches import FramePool
from training.networks.depth_network import NetworkShape
from training.settings import SizePhase, TrainingSettings
from training.trainer import Trainer

SMALL = NetworkShape(
    channels=(4, 4, 4, 4, 4),
    head_channels=4,
    frozen_stages=6,
    hint_channels=(4, 4, 4, 4, 4),
    correction_channels=4,
)
PHASES = (SizePhase(0.5, 64, 64, 2), SizePhase(1.0, 96, 64, 2))


def settings(images: int = 12) -> TrainingSettings:
    return TrainingSettings(images=images, phases=PHASES, large=None, shape=SMALL, precision="fp32")


def one_size(images: int = 4) -> TrainingSettings:
    """A run on pictures of 96x64 alone."""
    return replace(settings(images), phases=PHASES[-1:])


def two_steps(folder: Path) -> Checkpoint:
    """Of a narrow network, on a store of its own in that folder."""
    trainer = Trainer(one_size(), FramePool(make_store(folder)), pretrained=False)
    run_to_end(trainer)
    return trainer.checkpoint()


def run_to_end(trainer: Trainer) -> list[float]:
    return [float(report.terms.total) for report in trainer.run()]
