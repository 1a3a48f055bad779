"""The convolutions that the aggregation nodes and the decoder are made of."""

from __future__ import annotations

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


def upsample(features: Tensor) -> Tensor:
    """The map at twice its size, bilinear, pixel centres aligned."""
    return functional.interpolate(features, scale_factor=2.0, mode="bilinear", align_corners=False)
