"""Exponential moving average of the weights: what is evaluated and exported."""

from __future__ import annotations

import torch
from torch import Tensor, nn


class AverageWeights:
    """The average; normalisation statistics follow along, whole numbers are copied.

    Args:
        network: whose state is averaged.
        decay: share of the old average that a step keeps; lower during the first steps, so that the
            random start is forgotten.
    """

    def __init__(self, network: nn.Module, decay: float) -> None:
        self._decay = decay
        self.state: dict[str, Tensor] = {k: v.detach().clone() for k, v in network.state_dict().items()}

    @torch.no_grad()
    def update(self, network: nn.Module, step: int) -> None:
        """Take in the network after `step` steps."""
        decay = min(self._decay, (1 + step) / (10 + step))
        averages, values = [], []
        for name, value in network.state_dict().items():
            if value.is_floating_point():
                averages.append(self.state[name])
                values.append(value)
            else:
                self.state[name].copy_(value)
        torch._foreach_lerp_(averages, values, 1.0 - decay)
