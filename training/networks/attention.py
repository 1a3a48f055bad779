"""Efficient channel attention (ECA), equations 5 to 7 of the depth method."""

from __future__ import annotations

import math

import torch
from torch import Tensor, nn


def eca_kernel_size(channels: int) -> int:
    """Kernel over neighbouring channels: |(log2(s) + b) / gamma| to the nearest odd number, b = 1, gamma = 2.

    An even number lies between two odd ones; the larger is taken, as in the ECA paper (Wang et al. 2020).
    """
    if channels < 1:
        raise ValueError(f"channels is {channels}: at least 1 is needed")
    size = int(abs((math.log2(channels) + 1) / 2))
    return size if size % 2 else size + 1


class EfficientChannelAttention(nn.Module):
    """Weighs each channel by its mean and those of its neighbours, without reducing their number."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        kernel = eca_kernel_size(channels)
        self.across_channels = nn.Conv1d(1, 1, kernel, padding=kernel // 2, bias=False)

    def forward(self, features: Tensor) -> Tensor:
        mean = features.mean(dim=(2, 3))
        weights = torch.sigmoid(self.across_channels(mean[:, None]))[:, 0]
        return features * weights[:, :, None, None]
