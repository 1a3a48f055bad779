"""Hints at the resolutions of the network: measured points as sums that add up, and what lies between them.

A point is a value with a weight. Sums of weight and of weight times value pool exactly from level to level;
the gaps are filled coarse to fine ("push-pull", Gortler et al. 1996, section 3.4): where a cell has little
weight of its own, it takes the value of the next coarser level.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor
from torch.nn import functional

from training.networks.blocks import upsample
from uavdepth.model.hint_levels import (
    LEAST_WEIGHT,
    LEVELS,
    NEIGHBOURHOODS,
    PRIOR_WEIGHT,
    SMALLEST_Q,
    WHOLE_PRIOR,
)

_REWEIGHTINGS = 2


@dataclass(frozen=True)
class WeightedLevel:
    """Points of one resolution.

    Args:
        total: (N, C, h, w) sum of weight times value of the points in each cell.
        weight: (N, C, h, w) sum of their weights; 0 where there is none.
    """

    total: Tensor
    weight: Tensor

    @property
    def mean(self) -> Tensor:
        """(N, C, h, w) mean value in each cell, 0 where there is no point."""
        return self.total / self.weight.clamp_min(LEAST_WEIGHT)


@dataclass(frozen=True)
class HintPyramid:
    """Both hints at the levels 1/2 to 1/32.

    Args:
        points: log q of the points, weighted by confidence, finest first.
        ground: log q of the ground, weighted by the share of each cell that shows it, finest first.
    """

    points: Sequence[WeightedLevel]
    ground: Sequence[WeightedLevel]


def hint_pyramid(ground: Tensor, points: Tensor) -> HintPyramid:
    """Hints as the network takes them at every level.

    Args:
        ground: (N, 1, H, W) q of the flat ground, 0 where there is none; H and W divisible by 32.
        points: (N, 2, H, W) q of the points and the confidence in them, 0 where there is none.
    """
    confidence = points[:, 1:]
    known = (ground > 0).to(ground.dtype)
    return HintPyramid(
        pooled(WeightedLevel(confidence * _log(points[:, :1]), confidence), LEVELS, share=False),
        pooled(WeightedLevel(known * _log(ground), known), LEVELS, share=True),
    )


def pooled(level: WeightedLevel, count: int, share: bool) -> list[WeightedLevel]:
    """The next `count` coarser levels, each cell the sum (or the mean, for a `share`) of four finer ones."""
    factor = 1.0 if share else 4.0
    levels = []
    for _ in range(count):
        level = WeightedLevel(
            functional.avg_pool2d(level.total, 2) * factor, functional.avg_pool2d(level.weight, 2) * factor
        )
        levels.append(level)
    return levels


def fill(levels: Sequence[WeightedLevel], whole_prior: float = WHOLE_PRIOR) -> list[Tensor]:
    """Dense values of every level, finest first; 0 everywhere if there is no point at all.

    Args:
        levels: finest first, each of half the size of the one before.
        whole_prior: weight of the value 0 in the mean over the picture: larger trusts few points less.
    """
    coarsest = levels[-1]
    whole = WeightedLevel(
        coarsest.total.sum(dim=(2, 3), keepdim=True), coarsest.weight.sum(dim=(2, 3), keepdim=True)
    )
    value = whole.total / (whole.weight + whole_prior)
    for size in reversed(NEIGHBOURHOODS):
        value = _blended(WeightedLevel(_around(coarsest.total, size), _around(coarsest.weight, size)), value)
    filled = [_blended(coarsest, value)]
    for level in reversed(levels[:-1]):
        filled.append(_blended(level, upsample(filled[-1])))
    return filled[::-1]


def robust_weights(values: Tensor, weights: Tensor, scale: float) -> Tensor:
    """Weights of points, lowered for those far from the mean: w / (1 + ((value - mean) / scale)^2).

    Cauchy's weights (Holland and Welsch 1977), iterated: the second mean is hardly pulled by outliers.

    Args:
        values, weights: (N, 1, h, w); weight 0 where there is no point.
        scale: distance from the mean at which a weight is halved.
    """
    robust = weights
    for _ in range(_REWEIGHTINGS):
        mean = picture_mean(values, robust)
        robust = weights / (1.0 + ((values - mean) / scale) ** 2)
    return robust


def picture_mean(values: Tensor, weights: Tensor) -> Tensor:
    """(N, 1, 1, 1) weighted mean over each picture, 0 without weight."""
    total = (weights * values).sum(dim=(2, 3), keepdim=True)
    return total / (weights.sum(dim=(2, 3), keepdim=True) + 1e-6)


def _log(q: Tensor) -> Tensor:
    return torch.log(q.clamp_min(SMALLEST_Q))


def _blended(level: WeightedLevel, coarser: Tensor) -> Tensor:
    return (level.total + PRIOR_WEIGHT * coarser) / (level.weight + PRIOR_WEIGHT)


def _around(sums: Tensor, size: int) -> Tensor:
    """Sums over a square of `size` cells around each cell."""
    return functional.avg_pool2d(sums, size, stride=1, padding=size // 2) * float(size * size)
