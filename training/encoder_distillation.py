"""A start for ResNet-18 where no ImageNet weights are at hand: features of a network that has them.

No package carries ImageNet weights of ResNet-18, and a network that begins at random numbers spends a short
self-supervised run on learning what an edge is. EfficientNet-Lite0's ImageNet weights are packaged, so
ResNet-18 learns to tell its feature maps from the training pictures (Romero et al. 2015, FitNets). No depth
is involved: what follows stays self-supervised.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import torch
from torch import Tensor, nn
from torch.nn import functional

from training.networks.lite_encoder import LiteEncoder
from training.networks.resnet import ResNet18

_DEVIATION_FLOOR = 1e-3
"""Channels of the teacher that hardly move on a batch are not blown up to noise."""


@dataclass(frozen=True)
class DistillationStep:
    """One step: how many pictures were shown, and the mean error in standard deviations of the features."""

    images: int
    error: float


class EncoderDistillation:
    """Teaches a ResNet-18 the features of EfficientNet-Lite0.

    Args:
        images: how many pictures to show.
        learning_rate: of Adam at the start; falls to zero by half a cosine.
        seed: of the random weights.
    """

    def __init__(self, images: int, learning_rate: float = 1e-3, seed: int = 0) -> None:
        torch.manual_seed(seed)
        self._images = images
        self._rate = learning_rate
        self.student = ResNet18()
        self._teacher = LiteEncoder().eval().requires_grad_(False)
        self._translators = nn.ModuleList(
            nn.Conv2d(own, wanted, 1)
            for own, wanted in zip(ResNet18.channels, LiteEncoder.channels, strict=True)
        )
        for module in (self.student, self._teacher, self._translators):
            module.to(memory_format=torch.channels_last)  # type: ignore[call-overload]
        learning = [*self.student.parameters(), *self._translators.parameters()]
        self._optimizer = torch.optim.Adam(learning, lr=learning_rate, fused=True)

    def run(self, pictures: Iterable[Tensor]) -> Iterator[DistillationStep]:
        """Learn from batches of (N, 3, H, W) RGB in 0..1, until enough were shown."""
        self.student.train()
        shown = 0
        for batch in pictures:
            if shown >= self._images:
                return
            rate = self._rate * 0.5 * (1.0 + torch.cos(torch.tensor(torch.pi * shown / self._images)))
            for group in self._optimizer.param_groups:
                group["lr"] = float(rate)
            error = self._error(batch)
            self._optimizer.zero_grad(set_to_none=True)
            error.backward()  # type: ignore[no-untyped-call]
            self._optimizer.step()
            shown += len(batch)
            yield DistillationStep(shown, float(error.detach()))

    def _error(self, picture: Tensor) -> Tensor:
        """Mean over the five levels of the smooth L1 error of the standardised features."""
        with torch.no_grad():
            wanted = [_standardised(features) for features in self._teacher(picture)]
        told = self.student(picture)
        errors = [
            functional.smooth_l1_loss(translate(own), want)
            for translate, own, want in zip(self._translators, told, wanted, strict=True)
        ]
        return torch.stack(errors).mean()

    def save(self, path: Path) -> None:
        """Write the encoder as a state dict with torchvision's names."""
        path.parent.mkdir(parents=True, exist_ok=True)
        partial = path.with_name(path.name + ".part")
        torch.save(self.student.state_dict(), partial)
        partial.replace(path)


def _standardised(features: Tensor) -> Tensor:
    """Features with mean 0 and deviation 1 in each channel, over batch and picture."""
    mean = features.mean(dim=(0, 2, 3), keepdim=True)
    deviation = features.std(dim=(0, 2, 3), keepdim=True)
    return (features - mean) / deviation.clamp_min(_DEVIATION_FLOOR)
