"""Hints on their way into the network: added to the encoder's maps, and to the context of the picture."""

from __future__ import annotations

from collections.abc import Sequence

from torch import Tensor, nn
from torch.nn import functional

from training.networks.blocks import replicate_border
from training.networks.hint_levels import HintLevels
from uavdepth.model.hint_levels import LEVEL_CHANNELS, SUMMARY_CHANNELS


class HintEncoder(nn.Module):
    """Two small convolutions for each level of the pyramid; the last one begins as zero.

    Without normalisation layers: most hints are rare, and a batch's statistics of them would be noise.

    Args:
        channels: width of each level's map, finest first.
        hidden: width between the two convolutions of each level.
    """

    def __init__(self, channels: Sequence[int], hidden: Sequence[int]) -> None:
        super().__init__()
        self.first = nn.ModuleList(nn.Conv2d(LEVEL_CHANNELS, width, 3) for width in hidden)
        self.second = nn.ModuleList(
            # At half resolution a 3x3 would cost as much as all the others together.
            nn.Conv2d(width, out, 1 if level == 0 else 3)
            for level, (width, out) in enumerate(zip(hidden, channels, strict=True))
        )
        self.context = nn.Conv2d(SUMMARY_CHANNELS, channels[-1], 1)
        for layer in (*self.second, self.context):
            for parameter in layer.parameters():
                nn.init.zeros_(parameter)

    def forward(self, hints: HintLevels) -> tuple[list[Tensor], Tensor]:
        """What to add to each level's map, and (N, C, 1, 1) to add to the deepest level's context."""
        additions = []
        for level, (first, second) in enumerate(zip(self.first, self.second, strict=True)):
            hidden = functional.relu(first(replicate_border(hints.levels[level], 1)))
            additions.append(second(replicate_border(hidden, 0 if level == 0 else 1)))
        return additions, self.context(hints.summary)
