"""The convolutions that the aggregation nodes and the decoder are made of."""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional


class ConvNormRelu(nn.Module):
    """Convolution, batch normalisation, ReLU; the border is replicated.

    Zeros around the map would show the network an edge that is not in the world: a prototype with zero
    padding drew a false stripe of depth along the picture's border.
    """

    def __init__(self, inputs: int, outputs: int, kernel: int = 3) -> None:
        super().__init__()
        self.margin = kernel // 2
        self.convolution = nn.Conv2d(inputs, outputs, kernel, bias=False)
        self.norm = nn.BatchNorm2d(outputs)

    def forward(self, features: Tensor) -> Tensor:
        return functional.relu(
            self.norm(self.convolution(replicate_border(features, self.margin))), inplace=True
        )


def replicate_border(features: Tensor, margin: int) -> Tensor:
    """The map with its outermost pixels repeated `margin` times on each side."""
    return functional.pad(features, (margin,) * 4, mode="replicate") if margin else features


FEW_CHANNELS = 2
"""Of so few a map is enlarged by two products with constant matrices: on OpenVINO with AMX that took 1.6 ms
off the 21.2 ms of a network of 640x320, which has a dozen such maps (23 November 2026)."""


def upsample(features: Tensor) -> Tensor:
    """The map at twice its size, bilinear, pixel centres aligned."""
    if features.shape[1] > FEW_CHANNELS or features.device.type != "cpu":
        return functional.interpolate(features, scale_factor=2.0, mode="bilinear", align_corners=False)
    with torch.autocast("cpu", enabled=False):
        features = features.float()
        rows, columns = (_doubling(size, features) for size in features.shape[2:])
        return rows @ (features @ columns.T)


def _doubling(size: int, like: Tensor) -> Tensor:
    """(2 size, size): what each of twice as many samples takes of its neighbours, the ends repeated."""
    own = torch.eye(size, dtype=like.dtype, device=like.device)
    before, after = torch.cat([own[:1], own[:-1]]), torch.cat([own[1:], own[-1:]])
    return torch.stack([0.75 * own + 0.25 * before, 0.75 * own + 0.25 * after], dim=1).flatten(0, 1)
