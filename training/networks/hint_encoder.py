"""Hints on their way into the network: added to the encoder's maps, and to the context of the picture."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor, nn
from torch.nn import functional

from training.networks.blocks import replicate_border
from training.networks.hint_pyramid import HintPyramid, fill

LEVEL_INPUTS = 5
"""Filled log q of the points, their weight, whether there is one, log q of the ground, its share."""

CONTEXT_INPUTS = 3
"""Mean log q of the points, their number, whether there is one."""

_LOG_Q_MEAN = -2.5
_LOG_Q_SPREAD = 1.5
"""About those of a frame's pixels: 12 m, and from 2.7 to 55 m within one spread."""


def normalised(log_q: Tensor) -> Tensor:
    """Log q as numbers around 0."""
    return (log_q - _LOG_Q_MEAN) / _LOG_Q_SPREAD


class HintEncoder(nn.Module):
    """Two small convolutions for each level of the pyramid; the last one begins as zero.

    Without normalisation layers: most hints are rare, and a batch's statistics of them would be noise.

    Args:
        channels: width of each level's map, finest first.
        hidden: width between the two convolutions of each level.
    """

    def __init__(self, channels: Sequence[int], hidden: Sequence[int]) -> None:
        super().__init__()
        self.first = nn.ModuleList(nn.Conv2d(LEVEL_INPUTS, width, 3) for width in hidden)
        self.second = nn.ModuleList(
            # At half resolution a 3x3 would cost as much as all the others together.
            nn.Conv2d(width, out, 1 if level == 0 else 3)
            for level, (width, out) in enumerate(zip(hidden, channels, strict=True))
        )
        self.context = nn.Conv2d(CONTEXT_INPUTS, channels[-1], 1)
        for layer in (*self.second, self.context):
            for parameter in layer.parameters():
                nn.init.zeros_(parameter)

    def forward(self, hints: HintPyramid) -> tuple[list[Tensor], Tensor]:
        """What to add to each level's map, and (N, C, 1, 1) to add to the deepest level's context."""
        filled = fill(hints.points)
        anything = (hints.points[-1].weight.sum(dim=(2, 3), keepdim=True) > 0).to(filled[0].dtype)
        additions = []
        for level, (first, second) in enumerate(zip(self.first, self.second, strict=True)):
            points, ground = hints.points[level], hints.ground[level]
            stacked = torch.cat(
                [
                    normalised(filled[level]) * anything,
                    torch.log1p(points.weight),
                    points.weight.clamp_max(1.0),
                    normalised(ground.mean) * ground.weight,
                    ground.weight,
                ],
                dim=1,
            )
            hidden = functional.relu(first(replicate_border(stacked, 1)))
            additions.append(second(replicate_border(hidden, 0 if level == 0 else 1)))
        return additions, self.context(_summary(hints, anything))


def _summary(hints: HintPyramid, anything: Tensor) -> Tensor:
    """(N, 3, 1, 1) what the points say about the whole picture."""
    coarsest = hints.points[-1]
    weight = coarsest.weight.sum(dim=(2, 3), keepdim=True)
    mean = coarsest.total.sum(dim=(2, 3), keepdim=True) / weight.clamp_min(1e-6)
    return torch.cat([normalised(mean) * anything, torch.log1p(weight) / 5.0, anything], dim=1)
