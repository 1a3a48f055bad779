"""The training loop of the paper's method, on one process or many."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields, replace
from typing import Any, cast

import torch
from lightning_fabric import Fabric

from training.errors import CheckpointError, TrainingDataError, TrainingSettingsError
from training.photometric.loss import PhotometricSettings, PhotometricTerms, photometric_loss
from training.selfsupervised.depth_and_pose import DepthAndPose, Prediction
from training.selfsupervised.run_state import RunState
from training.selfsupervised.settings import SelfSupervisedSettings
from training.sequences.triplet_loader import LoaderSettings, TripletBatch, TripletLoader
from training.sequences.triplets import TripletSet


@dataclass(frozen=True)
class SelfSupervisedStep:
    """One step, for log and pictures.

    Args:
        step, images: counted from the start of the run, over all processes.
        trained_s: seconds of training.
        rate: learning rate.
        terms: the loss.
        batch, prediction: what it was made of, on this process.
    """

    step: int
    images: int
    trained_s: float
    rate: float
    terms: PhotometricTerms
    batch: TripletBatch
    prediction: Prediction


class SelfSupervisedTrainer:
    """Trains a depth and a pose network on triplets of frames.

    Args:
        settings: of the run.
        triplets: the frames.
        fabric: launched; tells device, processes and arithmetic.
        seconds: clock.

    Raises:
        TrainingSettingsError: a batch that the processes cannot share evenly.
    """

    def __init__(
        self,
        settings: SelfSupervisedSettings,
        triplets: TripletSet,
        fabric: Fabric,
        seconds: Callable[[], float] = time.monotonic,
    ) -> None:
        if settings.batch % fabric.world_size:
            raise TrainingSettingsError(
                f"batch is {settings.batch}: {fabric.world_size} processes cannot share it evenly"
            )
        self.settings = settings
        self.step = 0
        self.images = 0
        self.trained_s = 0.0
        self._fabric = fabric
        self._seconds = seconds
        self._loss = PhotometricSettings(**settings.loss.model_dump())
        share = LoaderSettings(
            settings.width,
            settings.height,
            settings.batch,
            settings.seed,
            rank=fabric.global_rank,
            world_size=fabric.world_size,
        )
        self._loader = TripletLoader(triplets, share, settings.cache)
        torch.manual_seed(settings.seed)
        networks = DepthAndPose(settings.network)
        networks.to(memory_format=torch.channels_last)  # type: ignore[call-overload]
        optimizer = torch.optim.Adam(networks.parameters(), lr=settings.learning_rate, fused=True)
        self._networks, self._optimizer = fabric.setup(networks, optimizer)

    @property
    def networks(self) -> DepthAndPose:
        """The networks as they stand."""
        return cast(DepthAndPose, self._networks.module)

    def resume(self, state: RunState) -> None:
        """Go on from a checkpoint.

        Raises:
            CheckpointError: it belongs to a run with other settings, or its networks have other shapes.
        """
        difference = self.settings.difference(state.settings)
        if difference:
            raise CheckpointError(f"the checkpoint belongs to another run: {difference}")
        try:
            self.networks.load_state_dict(state.networks)
            self._optimizer.load_state_dict(state.optimizer)
        except (RuntimeError, ValueError, KeyError) as error:
            raise CheckpointError(
                f"the checkpoint's networks are not those of these settings: {error}"
            ) from error
        self.step, self.images, self.trained_s = state.step, state.images, state.trained_s
        torch.set_rng_state(state.random)

    def state(self) -> RunState:
        """The run as it stands."""
        return RunState(
            self.settings,
            self.step,
            self.images,
            self.trained_s,
            self.networks.state_dict(),
            self._optimizer.state_dict(),
            torch.get_rng_state(),
        )

    def run(self) -> Iterator[SelfSupervisedStep]:
        """Train to the end, one report a step."""
        self._networks.train()
        started = self._seconds()
        for batch in self._loader.stream(self.step):
            if self.images >= self.settings.image_steps:
                return
            rate = self.settings.rate_at(self.images)
            batch = _on_device(batch, self._fabric)
            prediction, terms = self._learn(batch, rate)
            self.step += 1
            self.images += self.settings.batch
            now = self._seconds()
            self.trained_s += now - started
            started = now
            yield SelfSupervisedStep(self.step, self.images, self.trained_s, rate, terms, batch, prediction)

    def _learn(self, batch: TripletBatch, rate: float) -> tuple[Prediction, PhotometricTerms]:
        for group in self._optimizer.param_groups:
            group["lr"] = rate
        previous, following = batch.sources_jittered
        prediction: Prediction = self._networks(previous, batch.target_jittered, following)
        # Geometry and SSIM need all the digits: bf16 has three.
        terms = photometric_loss(
            [disparity.float() for disparity in prediction.disparities],
            batch.target,
            batch.sources,
            batch.intrinsics,
            [transform.float() for transform in prediction.source_from_target],
            self._loss,
        )
        if not torch.isfinite(terms.total):
            raise TrainingDataError(f"the loss of step {self.step} is {float(terms.total)}")
        self._optimizer.zero_grad(set_to_none=True)
        self._fabric.backward(cast(Any, terms.total))
        self._optimizer.step()
        return prediction, terms


def _on_device(batch: TripletBatch, fabric: Fabric) -> TripletBatch:
    return replace(
        batch, **{field.name: fabric.to_device(getattr(batch, field.name)) for field in fields(batch)}
    )
