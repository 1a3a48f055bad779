"""The paper's depth network (section 2.2) and the variants of its ablation (figure 6).

BL has Monodepth2's widths and plain skips, BL+FAN lays the nested nodes beside the skips, and the last two
weigh what every decoder stage has fused by squeeze-and-excitation or ECA. The seed's figures are not in its
text; these choices are ours, and alike in all four variants where they do not tell them apart:

- Batch normalisation and ReLU in the decoder: from an encoder without ImageNet weights and within a short
  training a normalised decoder learns faster, and for inference it folds into the convolutions.
- Borders are replicated, and the decoder repeats pixels when it up-samples, as Monodepth2's does.
- Attention sits behind the convolution that fuses a stage's maps, in all five stages.
- Aggregation nodes, as `aggregation.py` builds them: two with 16 channels at 1/2, two with 32 at 1/4, two
  with 64 at 1/8, one with 128 at 1/16. The encoder's 64 channels at 1/2 would cost 2.7 G multiply-adds more
  at 640x192.

15.1 M parameters; 9.2 G multiply-adds at 640x192, 1.15 times Monodepth2's.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum
from typing import cast

import torch
from torch import Tensor, nn

from training.networks.aggregation import AggregationGrid
from training.networks.attention import EfficientChannelAttention
from training.networks.blocks import ConvNormRelu
from training.networks.disparity import SCALES, DisparityNetwork, double_nearest
from training.networks.squeeze_excitation import SqueezeExcitation

DECODER_CHANNELS = (16, 32, 64, 128, 256)
"""Widths of the decoder at 1, 1/2, 1/4, 1/8 and 1/16 of the picture."""

NODE_CHANNELS = (16, 32, 64, 128, 128)
"""Widths of the aggregation grid at 1/2, 1/4, 1/8, 1/16 and 1/32; the last has no node and only feeds."""

NODE_COLUMNS = (2, 2, 2, 1, 0)
"""Aggregation nodes of each level."""


class Attention(Enum):
    """What weighs the channels of a decoder stage."""

    NONE = "none"
    SQUEEZE_EXCITATION = "se"
    EFFICIENT = "eca"

    def layer(self, channels: int) -> nn.Module:
        """The layer for a map of so many channels."""
        if self is Attention.SQUEEZE_EXCITATION:
            return SqueezeExcitation(channels)
        if self is Attention.EFFICIENT:
            return EfficientChannelAttention(channels)
        return nn.Identity()


class FeatureAggregation(nn.Module):
    """The FAN module: encoder maps brought to the nodes' widths, then the nested grid over them.

    Args:
        encoder_channels: widths of the encoder's five maps, finest first.
    """

    def __init__(self, encoder_channels: Sequence[int]) -> None:
        super().__init__()
        self.entries = nn.ModuleList(
            ConvNormRelu(inputs, width, kernel=1)
            for inputs, width in zip(encoder_channels, NODE_CHANNELS, strict=True)
        )
        self.grid = AggregationGrid(NODE_CHANNELS, NODE_COLUMNS, light_levels=0)

    def forward(self, pyramid: Sequence[Tensor]) -> list[Tensor]:
        """The last node at 1/2, 1/4, 1/8 and 1/16."""
        maps: list[Tensor] = self.grid(
            [entry(level) for entry, level in zip(self.entries, pyramid, strict=True)]
        )
        return maps[:-1]


class FusionStage(nn.Module):
    """One stage of the decoder (figure 3c): reduce, up-sample, fuse with the level's maps, weigh.

    Args:
        deeper_channels: width of the stage before, at half the resolution.
        channels: width of the output.
        skip_channels: width of the level's encoder map and node together; 0 at full resolution.
        attention: what weighs the fused map.
    """

    def __init__(self, deeper_channels: int, channels: int, skip_channels: int, attention: Attention) -> None:
        super().__init__()
        self.reduce = ConvNormRelu(deeper_channels, channels)
        self.fuse = ConvNormRelu(channels + skip_channels, channels)
        self.attention = attention.layer(channels)

    def forward(self, deeper: Tensor, skips: Sequence[Tensor]) -> Tensor:
        features = double_nearest(self.reduce(deeper))
        if skips:
            features = torch.cat([features, *skips], dim=1)
        weighed: Tensor = self.attention(self.fuse(features))
        return weighed


class PaperNetwork(DisparityNetwork):
    """BL and what is added to it.

    Args:
        encoder: a `PyramidEncoder`.
        aggregation: with the feature aggregation nodes.
        attention: at every decoder stage.
    """

    def __init__(self, encoder: nn.Module, *, aggregation: bool, attention: Attention) -> None:
        super().__init__(encoder, DECODER_CHANNELS[:SCALES])
        channels = cast(tuple[int, ...], encoder.channels)
        self.aggregation = FeatureAggregation(channels) if aggregation else None
        deeper = (*DECODER_CHANNELS[1:], channels[-1])
        nodes = NODE_CHANNELS if aggregation else (0,) * len(NODE_CHANNELS)
        skips = (0, *(a + b for a, b in zip(channels[:-1], nodes[:-1], strict=True)))
        self.stages = nn.ModuleList(
            FusionStage(*widths, attention) for widths in zip(deeper, DECODER_CHANNELS, skips, strict=True)
        )

    def decode(self, pyramid: Sequence[Tensor]) -> Sequence[Tensor]:
        skips: list[tuple[Tensor, ...]] = [(), *((level,) for level in pyramid[:-1])]
        if self.aggregation is not None:
            nodes = self.aggregation(pyramid)
            skips = [(), *zip(pyramid[:-1], nodes, strict=True)]
        features = pyramid[-1]
        maps: list[Tensor] = []
        for stage, level in zip(reversed(self.stages), reversed(skips), strict=True):
            features = stage(features, level)
            maps.append(features)
        return maps[::-1][:SCALES]
