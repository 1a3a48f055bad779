"""Pictures as the ImageNet encoders were taught to see them."""

from __future__ import annotations

import torch
from torch import Tensor, nn

IMAGENET_MEAN = (0.485, 0.456, 0.406)
IMAGENET_STD = (0.229, 0.224, 0.225)
"""Of RGB in 0..1, over ImageNet's training pictures: what torchvision's ResNets were trained with."""


class ImageNormalization(nn.Module):
    """RGB in 0..1 to zero mean and unit deviation, channel by channel.

    Args:
        mean, std: of red, green and blue.
    """

    mean: Tensor
    std: Tensor

    def __init__(
        self, mean: tuple[float, float, float] = IMAGENET_MEAN, std: tuple[float, float, float] = IMAGENET_STD
    ) -> None:
        super().__init__()
        # Not persistent: a torchvision state dict has no such entries, and ours should carry none either.
        self.register_buffer("mean", torch.tensor(mean).reshape(1, 3, 1, 1), persistent=False)
        self.register_buffer("std", torch.tensor(std).reshape(1, 3, 1, 1), persistent=False)

    def forward(self, image: Tensor) -> Tensor:
        return (image - self.mean) / self.std
