"""Feature aggregation nodes (FAN): the nested grid between encoder and decoder.

Node (i, j) of level i and column j fuses its left neighbour (i, j-1) with the up-sampled node (i+1, j-1)
of the next deeper level, as in UNet++ (Zhou et al. 2018); column 0 is the encoder. The last node of each
level goes to the decoder, so that it sees maps in which fine and coarse features have already mixed.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast

from torch import Tensor, nn
from torch.nn import functional

from training.networks.blocks import ConvNormRelu, replicate_border, upsample


class AggregationNode(nn.Module):
    """Fuses a map with the up-sampled map of the next deeper level.

    The deeper map is brought to the node's width before it is up-sampled and the two are added: that equals
    a 1x1 convolution over both stacked, at a quarter of its cost.
    """

    def __init__(self, channels: int, deeper_channels: int) -> None:
        super().__init__()
        self.from_deeper = nn.Conv2d(deeper_channels, channels, 1, bias=False)
        self.fuse = ConvNormRelu(channels, channels)

    def forward(self, level: Tensor, deeper: Tensor) -> Tensor:
        fused: Tensor = self.fuse(level + upsample(self.from_deeper(deeper)))
        return fused


class LightAggregationNode(nn.Module):
    """The same with a depthwise convolution, for half resolution, where full ones would cost the most."""

    def __init__(self, channels: int, deeper_channels: int) -> None:
        super().__init__()
        self.from_deeper = nn.Conv2d(deeper_channels, channels, 1, bias=False)
        self.depthwise = nn.Conv2d(channels, channels, 3, groups=channels, bias=False)
        self.mix = ConvNormRelu(channels, channels, kernel=1)

    def forward(self, level: Tensor, deeper: Tensor) -> Tensor:
        fused = functional.relu(level + upsample(self.from_deeper(deeper)))
        mixed: Tensor = self.mix(self.depthwise(replicate_border(fused, 1)))
        return mixed


class AggregationGrid(nn.Module):
    """The triangle of nodes over a pyramid of maps.

    Args:
        channels: width of each level's map, finest first.
        columns: how many nodes each level has; level i may have at most one more than level i+1.
        light_levels: levels, counted from the finest, whose nodes are depthwise.
    """

    def __init__(self, channels: Sequence[int], columns: Sequence[int], light_levels: int = 1) -> None:
        super().__init__()
        if len(columns) != len(channels):
            raise ValueError(f"{len(columns)} column counts for {len(channels)} levels")
        for level in range(len(channels) - 1):
            if columns[level] > columns[level + 1] + 1:
                raise ValueError(
                    f"level {level} has {columns[level]} nodes, at most {columns[level + 1] + 1} can be fed"
                )
        if columns[-1]:
            raise ValueError(f"the deepest level has {columns[-1]} nodes but nothing deeper to fuse")
        self.columns = tuple(columns)
        self.levels = nn.ModuleList()
        for level, count in enumerate(columns):
            kind = LightAggregationNode if level < light_levels else AggregationNode
            nodes = [kind(channels[level], channels[level + 1]) for _ in range(count)]
            self.levels.append(nn.ModuleList(nodes))

    def forward(self, pyramid: Sequence[Tensor]) -> list[Tensor]:
        """The last node of each level; a level without nodes gives its map back unchanged."""
        grid: list[list[Tensor]] = [[] for _ in self.levels]
        for level in reversed(range(len(self.levels))):
            row = [pyramid[level]]
            nodes = cast(nn.ModuleList, self.levels[level])
            for column, node in enumerate(nodes):
                row.append(node(row[-1], grid[level + 1][column]))
            grid[level] = row
        return [row[-1] for row in grid]
