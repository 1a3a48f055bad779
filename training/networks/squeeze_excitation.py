"""Squeeze and excitation (Hu et al. 2018): what ECA is compared with, and the heart of HR-Depth's fusion."""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional

REDUCTION = 16
_FEWEST_HIDDEN = 4
"""The two finest stages of the paper's decoder would be squeezed into one or two numbers otherwise."""


class SqueezeExcitation(nn.Module):
    """Weighs each channel by what two small dense layers make of the means of all channels.

    Args:
        channels: width of the map.
        reduction: channels to hidden numbers, which are at least 4.
    """

    def __init__(self, channels: int, reduction: int = REDUCTION) -> None:
        super().__init__()
        hidden = max(channels // reduction, _FEWEST_HIDDEN)
        self.squeeze = nn.Linear(channels, hidden)
        self.excite = nn.Linear(hidden, channels)

    def forward(self, features: Tensor) -> Tensor:
        hidden = functional.relu(self.squeeze(features.mean(dim=(2, 3))))
        return features * torch.sigmoid(self.excite(hidden))[:, :, None, None]
