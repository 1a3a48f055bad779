"""The training loop."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import torch
from torch import nn

from training.averaging import AverageWeights
from training.checkpoint import Checkpoint, read_weights
from training.data.batches import Batch, BatchRequest, BatchSource, FramePool
from training.errors import CheckpointError, TrainingDataError
from training.exported_weights import take_exported
from training.losses import LossTerms, depth_loss
from training.networks.depth_network import DepthNetwork
from training.precision import autocast, resolve_precision
from training.settings import TrainingSettings

RESCAN_EVERY_STEPS = 100
EXPORTED_SUFFIX = ".onnx"
STATISTICS_BATCHES = 24
"""That the normalisations of an exported network get their statistics from."""

_BATCHES_AHEAD = 2


@dataclass(frozen=True)
class StepReport:
    """One step, for the log."""

    step: int
    images: int
    trained_s: float
    progress: float
    rate_factor: float
    terms: LossTerms


class Trainer:
    """Trains one network on one frame store.

    Args:
        settings: of the run.
        pool: the frames.
        pretrained: start from the ImageNet encoder.
        seconds: the clock that a run in minutes is measured with.
    """

    def __init__(
        self,
        settings: TrainingSettings,
        pool: FramePool,
        pretrained: bool = True,
        seconds: Callable[[], float] = time.monotonic,
    ) -> None:
        self.settings = settings
        self.step = 0
        self.images = 0
        self.trained_s = 0.0
        self._pool = pool
        self._source = BatchSource(pool, settings.seed, _BATCHES_AHEAD, settings.hints, settings.appearance)
        self._seconds = seconds
        self._precision = resolve_precision(settings.precision)
        torch.manual_seed(settings.seed)
        self.network = DepthNetwork(settings.shape)
        if pretrained:
            self.network.encoder.load_imagenet()
        self.network.to(memory_format=torch.channels_last)  # type: ignore[call-overload]
        self._average = AverageWeights(self.network, settings.average_decay)
        self._optimizer = _optimizer(self.network, settings)

    @classmethod
    def resume(
        cls,
        checkpoint: Checkpoint,
        pool: FramePool,
        settings: TrainingSettings | None = None,
        seconds: Callable[[], float] = time.monotonic,
    ) -> Trainer:
        """Go on from a checkpoint, with its settings unless others are given (another length, say)."""
        trainer = cls(settings or checkpoint.settings, pool, pretrained=False, seconds=seconds)
        checkpoint.restore(trainer.network)
        trainer._average.state = {k: v.clone() for k, v in checkpoint.average.items()}
        trainer._optimizer.load_state_dict(checkpoint.optimizer)
        trainer.step, trainer.images = checkpoint.step, checkpoint.images
        trainer.trained_s = checkpoint.trained_s
        return trainer

    def start_from(self, path: Path) -> int:
        """Take over the weights of another run's checkpoint wherever name and shape fit, or of an export.

        Returns:
            How many of the network's weights were found there.

        Raises:
            CheckpointError: a file that is neither, or none of whose weights fits.
        """
        if path.suffix == EXPORTED_SUFFIX:
            taken = take_exported(path, self.network, map(self._source.make, self._statistics_requests()))
            self._average = AverageWeights(self.network, self.settings.average_decay)
            return taken
        weights = read_weights(path)
        state = self.network.state_dict()
        fitting = {
            name: value
            for name, value in weights.items()
            if name in state and state[name].shape == value.shape
        }
        if not fitting:
            raise CheckpointError(f"{path}: none of its {len(weights)} weights fits the network")
        self.network.load_state_dict(fitting, strict=False)
        self._average = AverageWeights(self.network, self.settings.average_decay)
        return sum(value.numel() for value in fitting.values())

    @property
    def progress(self) -> float:
        """Share of the run that is done."""
        return self.settings.progress(self.images, self.trained_s)

    @property
    def frames(self) -> int:
        """Size of the training set."""
        return len(self._pool)

    def run(self) -> Iterator[StepReport]:
        """Train to the end, one report a step."""
        self.network.train()
        requests = self._requests()
        started = self._seconds()
        for batch in self._source.stream(requests):
            factor = self.settings.rate_factor(self.progress)
            terms = self._learn(batch, factor)
            self.step += 1
            self.images += len(batch.image)
            self._average.update(self.network, self.step)
            now = self._seconds()
            self.trained_s += now - started
            started = now
            if self.step % RESCAN_EVERY_STEPS == 0:
                self._pool.rescan()
            yield StepReport(self.step, self.images, self.trained_s, self.progress, factor, terms)
            if self.progress >= 1.0:
                return

    def checkpoint(self) -> Checkpoint:
        """The run as it stands."""
        return Checkpoint(
            self.settings,
            self.step,
            self.images,
            self.trained_s,
            self.network.state_dict(),
            self._average.state,
            self._optimizer.state_dict(),
            len(self._pool),
            self._pool.worlds,
        )

    def save(self, path: Path) -> None:
        """Write the checkpoint."""
        self.checkpoint().save(path)

    def _requests(self) -> Iterator[BatchRequest]:
        """Batches to make, numbered by step; made ahead, so pictures are counted as requested here."""
        number, images = self.step, self.images
        while (progress := self.settings.progress(images, self.trained_s)) < 1.0:
            size = self.settings.size_of(number, progress)
            yield BatchRequest(number, size.batch, size.width, size.height)
            number, images = number + 1, images + size.batch

    def _statistics_requests(self) -> Iterator[BatchRequest]:
        """The first batches of the last phase."""
        size = self.settings.phases[-1]
        for number in range(STATISTICS_BATCHES):
            yield BatchRequest(number, size.batch, size.width, size.height)

    def _learn(self, batch: Batch, factor: float) -> LossTerms:
        for group in self._optimizer.param_groups:
            group["lr"] = group["highest_rate"] * factor
        with autocast(self._precision):
            output = self.network(batch.image, batch.ground, batch.points)
        terms = depth_loss(output, batch, self.settings.loss)
        if not torch.isfinite(terms.total):
            raise TrainingDataError(
                f"the loss of step {self.step} is {float(terms.total)}: a frame is broken"
            )
        self._optimizer.zero_grad(set_to_none=True)
        terms.total.backward()  # type: ignore[no-untyped-call]
        nn.utils.clip_grad_norm_(self.network.parameters(), self.settings.clip_norm)
        self._optimizer.step()
        return terms.detached()


def _optimizer(network: DepthNetwork, settings: TrainingSettings) -> torch.optim.Optimizer:
    encoder = [p for p in network.encoder.parameters() if p.requires_grad]
    inside = {id(p) for p in network.encoder.parameters()}
    others = [p for p in network.parameters() if p.requires_grad and id(p) not in inside]
    groups = [
        {"params": encoder, "highest_rate": settings.encoder_rate},
        {"params": others, "highest_rate": settings.decoder_rate},
    ]
    return torch.optim.AdamW(
        [group for group in groups if group["params"]],
        lr=settings.decoder_rate,
        weight_decay=settings.weight_decay,
        fused=True,
    )
