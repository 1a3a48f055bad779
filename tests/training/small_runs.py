"""Training runs of seconds."""

from __future__ import annotations

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


def run_to_end(trainer: Trainer) -> list[float]:
    return [float(report.terms.total) for report in trainer.run()]
