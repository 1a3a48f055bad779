"""Monodepth2's depth network (Godard et al. 2019): the baseline that the paper builds on.

14.3 M parameters, 8.0 G multiply-adds at 640x192.
"""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor, nn
from torch.nn import functional

from training.networks.disparity import SCALES, DisparityNetwork, ReflectConv, double_nearest
from training.networks.resnet import RESNET18_CHANNELS, ResNet18

DECODER_CHANNELS = (16, 32, 64, 128, 256)
"""Widths of the decoder at 1, 1/2, 1/4, 1/8 and 1/16 of the picture."""


class ConvElu(nn.Module):
    """3x3 convolution with reflection padding, then ELU."""

    def __init__(self, inputs: int, outputs: int) -> None:
        super().__init__()
        self.convolution = ReflectConv(inputs, outputs)

    def forward(self, features: Tensor) -> Tensor:
        return functional.elu(self.convolution(features), inplace=True)


class PlainStage(nn.Module):
    """Convolution, nearest up-sampling, concatenation with the encoder's map, convolution.

    Args:
        deeper_channels: width of the stage before, at half the resolution.
        channels: width of the output.
        skip_channels: width of the encoder's map; 0 at full resolution, where the encoder has none.
    """

    def __init__(self, deeper_channels: int, channels: int, skip_channels: int) -> None:
        super().__init__()
        self.reduce = ConvElu(deeper_channels, channels)
        self.fuse = ConvElu(channels + skip_channels, channels)

    def forward(self, deeper: Tensor, skip: Tensor | None) -> Tensor:
        features = double_nearest(self.reduce(deeper))
        if skip is not None:
            features = torch.cat([features, skip], dim=1)
        fused: Tensor = self.fuse(features)
        return fused


class Monodepth2(DisparityNetwork):
    """ResNet-18 and the plain decoder."""

    def __init__(self) -> None:
        super().__init__(ResNet18(), DECODER_CHANNELS[:SCALES])
        deeper = (*DECODER_CHANNELS[1:], RESNET18_CHANNELS[-1])
        skips = (0, *RESNET18_CHANNELS[:-1])
        self.stages = nn.ModuleList(
            PlainStage(*widths) for widths in zip(deeper, DECODER_CHANNELS, skips, strict=True)
        )

    def decode(self, pyramid: Sequence[Tensor]) -> Sequence[Tensor]:
        skips = [None, *pyramid[:-1]]
        features = pyramid[-1]
        maps: list[Tensor] = []
        for stage, skip in zip(reversed(self.stages), reversed(skips), strict=True):
            features = stage(features, skip)
            maps.append(features)
        return maps[::-1][:SCALES]
