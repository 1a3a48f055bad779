"""HR-Depth's network (Lyu et al. 2021): nested nodes between encoder and decoder, the second baseline.

Node X_ij, level i (0 at half resolution) and column j, takes the deeper neighbour X_(i+1)(j-1), brought to
half its width by a 3x3 convolution and up-sampled, and all earlier nodes of its level. Column 0 is the
encoder; every node has the width of the encoder's map of its level. The nodes with i + j = 4 are the decoder.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast

import torch
from torch import Tensor, nn
from torch.nn import functional

from training.networks.disparity import SCALES, DisparityNetwork, double_nearest
from training.networks.monodepth2 import ConvElu
from training.networks.resnet import RESNET18_CHANNELS, ResNet18
from training.networks.squeeze_excitation import SqueezeExcitation

FULL_RESOLUTION_CHANNELS = 16
_DEEPEST = len(RESNET18_CHANNELS) - 1


class FeatureFusion(nn.Module):
    """Squeeze-and-excitation over all stacked maps, then a 1x1 convolution and ReLU (fSE)."""

    def __init__(self, inputs: int, outputs: int) -> None:
        super().__init__()
        self.attention = SqueezeExcitation(inputs)
        self.mix = nn.Conv2d(inputs, outputs, 1)

    def forward(self, features: Tensor) -> Tensor:
        return functional.relu(self.mix(self.attention(features)), inplace=True)


class NestedNode(nn.Module):
    """X_ij: fuses the earlier nodes of its level with the deeper neighbour.

    Args:
        channels, deeper_channels: widths of this level's and the next deeper level's nodes.
        column: j, also the number of earlier nodes of the level.
        outermost: on the diagonal i + j = 4, where fSE fuses; inside, a 3x3 convolution does, after a 1x1
            convolution to the node's width when more than two maps meet.
    """

    def __init__(self, channels: int, deeper_channels: int, column: int, *, outermost: bool) -> None:
        super().__init__()
        risen = deeper_channels // 2
        stacked = risen + column * channels
        self.rise = ConvElu(deeper_channels, risen)
        self.fuse: nn.Module
        if outermost:
            self.fuse = FeatureFusion(stacked, channels)
        elif column > 1:
            self.fuse = nn.Sequential(nn.Conv2d(stacked, channels, 1), ConvElu(channels, channels))
        else:
            self.fuse = ConvElu(stacked, channels)

    def forward(self, earlier: Sequence[Tensor], deeper: Tensor) -> Tensor:
        fused: Tensor = self.fuse(torch.cat([double_nearest(self.rise(deeper)), *earlier], dim=1))
        return fused


class HRDepth(DisparityNetwork):
    """ResNet-18 and the full triangle of nodes; heads on X_22, X_13, X_04 and a full-size stage."""

    def __init__(self) -> None:
        super().__init__(ResNet18(), (FULL_RESOLUTION_CHANNELS, *RESNET18_CHANNELS[: SCALES - 1]))
        self.levels = nn.ModuleList()
        for level in range(_DEEPEST):
            channels, deeper = RESNET18_CHANNELS[level], RESNET18_CHANNELS[level + 1]
            last = _DEEPEST - level
            self.levels.append(
                nn.ModuleList(
                    NestedNode(channels, deeper, column, outermost=column == last)
                    for column in range(1, last + 1)
                )
            )
        finest = RESNET18_CHANNELS[0]
        self.rise = ConvElu(finest, FULL_RESOLUTION_CHANNELS)
        self.finest = ConvElu(FULL_RESOLUTION_CHANNELS, FULL_RESOLUTION_CHANNELS)

    def decode(self, pyramid: Sequence[Tensor]) -> Sequence[Tensor]:
        deeper = [pyramid[-1]]
        diagonal: list[Tensor] = []
        for level in reversed(range(_DEEPEST)):
            row = [pyramid[level]]
            for column, node in enumerate(cast(nn.ModuleList, self.levels[level])):
                row.append(node(row, deeper[column]))
            diagonal.append(row[-1])
            deeper = row
        full = self.finest(double_nearest(self.rise(diagonal[-1])))
        return [full, *diagonal[::-1][: SCALES - 1]]
