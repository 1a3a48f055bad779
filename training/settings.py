"""What a training run is made of, written into its checkpoints."""

from __future__ import annotations

import math
from dataclasses import astuple, dataclass, field, replace

from training.data.hint_sampling import HintShares
from training.data.surface_patterns import AppearanceShares
from training.errors import TrainingSettingsError
from training.losses import LossWeights
from training.networks.depth_network import NetworkShape


@dataclass(frozen=True)
class SizePhase:
    """A picture size and how long it is used.

    Args:
        until: share of the run (0 to 1) at which it ends.
        width, height: of the network's picture, divisible by 32.
        batch: pictures in a step.
    """

    until: float
    width: int
    height: int
    batch: int

    def __post_init__(self) -> None:
        if self.width % 32 or self.height % 32 or self.width < 64 or self.height < 64:
            raise TrainingSettingsError(
                f"picture size {self.width}x{self.height} is not a multiple of 32 from 64"
            )
        if self.batch < 2:
            raise TrainingSettingsError(f"batch is {self.batch}: batch normalisation needs at least 2")


DEFAULT_PHASES = (SizePhase(0.5, 320, 160, 8), SizePhase(1.0, 384, 192, 8))
"""Half the run on smaller pictures, a third faster; the rest at the smaller of the exported sizes."""


@dataclass(frozen=True)
class LargePictures:
    """Batches of another size in the last phase: one network is to serve both exported sizes.

    Args:
        every: of so many batches one is large.
        width, height, batch: as in `SizePhase`.
    """

    every: int = 3
    width: int = 640
    height: int = 320
    batch: int = 3

    def __post_init__(self) -> None:
        SizePhase(1.0, self.width, self.height, self.batch)
        if self.every < 1:
            raise TrainingSettingsError(f"one of {self.every} batches is large: at least 1 is needed")


@dataclass(frozen=True)
class TrainingSettings:
    """One run.

    Args:
        images: length of the run in pictures, or None.
        minutes: length of the run in minutes of training, or None; exactly one of the two is given.
        phases: picture sizes.
        large: larger pictures among those of the last phase, or None.
        decoder_rate, encoder_rate: highest learning rates of Adam.
        warm_up: share of the run in which the rates rise.
        final_rate: rates at the end, as a share of the highest.
        weight_decay: of AdamW.
        clip_norm: largest gradient norm.
        average_decay: of the exponential moving average of the weights, per step.
        seed: of the order of pictures and of random weights.
        precision: "auto", "fp32" or "bf16".
        hints: how often each subset of hints comes.
        appearance: how often surfaces get another look.
        loss: weights of the terms.
        shape: of the network.
    """

    images: int | None = None
    minutes: float | None = None
    phases: tuple[SizePhase, ...] = DEFAULT_PHASES
    large: LargePictures | None = field(default_factory=LargePictures)
    decoder_rate: float = 2e-3
    encoder_rate: float = 4e-4
    warm_up: float = 0.05
    final_rate: float = 0.01
    weight_decay: float = 0.01
    clip_norm: float = 2.0
    average_decay: float = 0.997
    seed: int = 0
    precision: str = "auto"
    hints: HintShares = field(default_factory=HintShares)
    appearance: AppearanceShares = field(default_factory=AppearanceShares)
    loss: LossWeights = field(default_factory=LossWeights)
    shape: NetworkShape = field(default_factory=NetworkShape)

    def __post_init__(self) -> None:
        if (self.images is None) == (self.minutes is None):
            raise TrainingSettingsError(
                "a run is as long as its images or as its minutes: give one of the two"
            )
        length = self.images if self.images is not None else self.minutes
        if length is None or not (math.isfinite(length) and length > 0):
            raise TrainingSettingsError(f"the run's length is {length}: above 0 is needed")
        ends = [phase.until for phase in self.phases]
        if not ends or ends != sorted(ends) or ends[-1] != 1.0:
            raise TrainingSettingsError(f"phases end at {ends}: rising numbers are needed, the last one 1.0")

    def progress(self, images: int, trained_s: float) -> float:
        """Share of the run that is done, 0 to 1."""
        if self.images is not None:
            return min(images / self.images, 1.0)
        return min(trained_s / (60.0 * (self.minutes or 1.0)), 1.0)

    def phase_at(self, progress: float) -> SizePhase:
        """The phase in use."""
        return next((phase for phase in self.phases if progress < phase.until), self.phases[-1])

    def size_of(self, number: int, progress: float) -> SizePhase:
        """Size of the batch of that number."""
        phase = self.phase_at(progress)
        if self.large is None or phase is not self.phases[-1] or number % self.large.every:
            return phase
        return SizePhase(phase.until, self.large.width, self.large.height, self.large.batch)

    def rate_factor(self, progress: float) -> float:
        """Share of the highest learning rates: a linear rise, then half a cosine down (one cycle)."""
        if progress < self.warm_up:
            return 0.05 + 0.95 * progress / self.warm_up
        fall = (progress - self.warm_up) / (1.0 - self.warm_up)
        return self.final_rate + (1.0 - self.final_rate) * 0.5 * (1.0 + math.cos(math.pi * min(fall, 1.0)))


FINE_TUNING_RATE = 0.35
"""Of the highest learning rates: enough to learn by, and little enough not to begin anew."""


def for_fine_tuning(settings: TrainingSettings) -> TrainingSettings:
    """The same for a run that begins with a trained network.

    Lower rates, the exported sizes from the start, and half as many changed surfaces: those teach what a
    trained network lacks, but what it is measured by is the worlds as they are. Nothing stays frozen: the
    encoder's first stages keep ImageNet's weights from what an untrained decoder would do to them, and a
    trained one gets more out of them by teaching them too.
    """
    return replace(
        settings,
        phases=settings.phases[-1:],
        decoder_rate=FINE_TUNING_RATE * settings.decoder_rate,
        encoder_rate=FINE_TUNING_RATE * settings.encoder_rate,
        appearance=AppearanceShares(*(share / 2 for share in astuple(settings.appearance))),
        shape=replace(settings.shape, frozen_stages=0),
    )
