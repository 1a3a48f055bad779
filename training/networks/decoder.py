"""The decoder: up-samples stage by stage, each stage weighed by channel attention."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor, nn

from training.networks.attention import EfficientChannelAttention
from training.networks.blocks import ConvNormRelu, replicate_border, upsample


class DecoderStage(nn.Module):
    """Fuses the stage before, the encoder's map and the aggregated map of one level, then ECA.

    Args:
        deeper_channels: width of the stage before, at half this stage's resolution.
        channels: width of the level's maps and of the output.
    """

    def __init__(self, deeper_channels: int, channels: int) -> None:
        super().__init__()
        self.from_deeper = nn.Conv2d(deeper_channels, channels, 1, bias=False)
        self.fuse = ConvNormRelu(3 * channels, channels)
        self.attention = EfficientChannelAttention(channels)

    def forward(self, deeper: Tensor, lateral: Tensor, aggregated: Tensor) -> Tensor:
        stacked = torch.cat([upsample(self.from_deeper(deeper)), lateral, aggregated], dim=1)
        weighed: Tensor = self.attention(self.fuse(stacked))
        return weighed


class Decoder(nn.Module):
    """Stages from the deepest level to the finest.

    Args:
        channels: width of each level, finest first.
    """

    def __init__(self, channels: Sequence[int]) -> None:
        super().__init__()
        self.stages = nn.ModuleList(
            DecoderStage(channels[level + 1], channels[level]) for level in range(len(channels) - 1)
        )

    def forward(self, laterals: Sequence[Tensor], aggregated: Sequence[Tensor]) -> Tensor:
        """The finest stage's features."""
        features = laterals[-1]
        for level in reversed(range(len(self.stages))):
            features = self.stages[level](features, laterals[level], aggregated[level])
        return features


class Head(nn.Module):
    """One number per pixel from the decoder's features, at their resolution."""

    def __init__(self, inputs: int, hidden: int, initial: float) -> None:
        super().__init__()
        self.hidden = ConvNormRelu(inputs, hidden)
        self.output = nn.Conv2d(hidden, 1, 3)
        nn.init.normal_(self.output.weight, std=0.01)
        nn.init.constant_(self.output.bias, initial)  # type: ignore[arg-type]

    def forward(self, features: Tensor) -> Tensor:
        output: Tensor = self.output(replicate_border(self.hidden(features), 1))
        return output
