"""The last stage: what the points say about the prediction, carried to every pixel, and how sure that is."""

from __future__ import annotations

import math

import torch
from torch import Tensor, nn
from torch.nn import functional

from training.networks.blocks import replicate_border
from training.networks.hint_levels import HintLevels, normalised
from training.networks.hint_pyramid import WeightedLevel, fill, picture_mean, pooled, robust_weights
from uavdepth.model.hint_levels import LEVELS, NEARNESS_CHANNELS

OUTLIER_SCALE = 0.3
"""Distance (of log depth) from the picture's mean correction at which a point counts half."""

LARGEST_CORRECTION = 3.0
"""Of log depth, a factor of 20."""

FEW_POINTS = 0.1
"""Weight of "no correction" against the points of a picture: a tenth of one sure point."""

_EXTRA_INPUTS = 5 + NEARNESS_CHANNELS


class HintCorrection(nn.Module):
    """Corrects a prediction by the points, then by what small convolutions learn; begins as the former.

    The residual of the points (their log q less the predicted one) is weighed robustly, filled to a dense
    map and added: without points the prediction stays as it is. The convolutions see the features, the
    prediction, the correction, one without robust weights (for an obstacle that the prediction missed, but
    several points met), how near points are, how well they agree, and the ground's residual.

    Args:
        features: width of the decoder's features.
        hidden: width of the two hidden layers.
        relative_sigma: that an untrained network gives.
    """

    def __init__(self, features: int, hidden: int, relative_sigma: float) -> None:
        super().__init__()
        self.first = nn.Conv2d(features + _EXTRA_INPUTS, hidden, 3)
        self.second = nn.Conv2d(hidden, hidden, 3)
        self.output = nn.Conv2d(hidden, 2, 3)
        nn.init.zeros_(self.output.weight)
        with torch.no_grad():
            self.output.bias.copy_(torch.tensor([0.0, math.log(relative_sigma)]))  # type: ignore[union-attr]

    def forward(self, features: Tensor, prediction: Tensor, hints: HintLevels) -> tuple[Tensor, Tensor]:
        """Corrected log inverse depth and log sigma, (N, 1, h, w) each, at the features' resolution."""
        mean, weight, ground = (hints.measured[:, channel : channel + 1] for channel in range(3))
        robust, plain, spread = point_corrections(prediction, mean, weight)
        difference = (ground - prediction).clamp(-LARGEST_CORRECTION, LARGEST_CORRECTION)
        stacked = torch.cat(
            [
                features,
                normalised(prediction),
                robust,
                plain - robust,
                spread.expand_as(robust),
                difference * hints.nearness[:, :1],
                hints.nearness,
            ],
            dim=1,
        )
        hidden = functional.relu(self.first(replicate_border(stacked, 1)))
        hidden = functional.relu(self.second(replicate_border(hidden, 1)))
        learnt, log_sigma = self.output(replicate_border(hidden, 1)).split(1, dim=1)
        return prediction + robust + learnt, log_sigma


def point_corrections(prediction: Tensor, mean: Tensor, weight: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Dense corrections of log inverse depth that the points ask for.

    Args:
        prediction: (N, 1, h, w) at half the picture's size.
        mean, weight: (N, 1, h, w) log q of the points in each cell, and their weight.

    Returns:
        (N, 1, h, w) with robust weights, (N, 1, h, w) with the plain ones, and (N, 1, 1, 1) the spread of
        the points' residuals; all 0 without points.
    """
    residual = (mean - prediction).clamp(-LARGEST_CORRECTION, LARGEST_CORRECTION)
    # Weights that follow the prediction would reward predictions that make outliers of inconvenient points.
    robust = robust_weights(residual.detach(), weight, OUTLIER_SCALE)
    # Stacked as pictures, not as channels: maps of one channel are pooled in half the time.
    weights = torch.cat([robust, weight])
    weighted = WeightedLevel(weights * torch.cat([residual, residual]), weights)
    filled = fill([weighted, *pooled(weighted, LEVELS - 1, share=False)], FEW_POINTS)[0]
    deviation = (residual - picture_mean(residual, robust)).abs()
    with_robust, with_plain = filled.chunk(2)
    return with_robust, with_plain, picture_mean(deviation, robust)
