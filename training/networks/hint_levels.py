"""Hints as the network takes them: everything about them that depends on nothing else.

For training they are made from full planes here; in flight `uavdepth.model.hint_levels` makes the same.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from training.networks.blocks import upsample
from training.networks.hint_pyramid import HintPyramid, fill, hint_pyramid
from uavdepth.model.hint_levels import COUNT_SCALE, LEAST_WEIGHT, LOG_Q_MEAN, LOG_Q_SPREAD, WEIGHT_LEVELS


@dataclass(frozen=True)
class HintLevels:
    """Inputs of the network; all 0 where nothing is known.

    Args:
        levels: (N, 5, h, w) each, finest first, of 1/2 to 1/32 of the picture's size: filled log q of the
            points, their weight, whether there is one, log q of the ground, its share.
        summary: (N, 3, 1, 1) mean log q of the points, their number, whether there is one.
        measured: (N, 3, h, w) at half size: mean log q of the points, their weight, mean log q of the ground.
        nearness: (N, 4, h, w) at half size: share of the ground, weight of the points around at some levels.
    """

    levels: Sequence[Tensor]
    summary: Tensor
    measured: Tensor
    nearness: Tensor

    @classmethod
    def of_inputs(cls, inputs: Sequence[Tensor]) -> HintLevels:
        """From the exported network's inputs, in the order of `uavdepth.model.hint_levels.hint_shapes`."""
        *levels, summary, measured, nearness = inputs
        return cls(levels, summary, measured, nearness)

    @property
    def inputs(self) -> tuple[Tensor, ...]:
        """The same in that order."""
        return (*self.levels, self.summary, self.measured, self.nearness)


def hint_levels(ground: Tensor, points: Tensor) -> HintLevels:
    """Hints at every level.

    Args:
        ground: (N, 1, H, W) q of the flat ground, 0 where there is none; H and W divisible by 32.
        points: (N, 2, H, W) q of the points and the confidence in them, 0 where there is none.
    """
    hints = hint_pyramid(ground, points)
    filled = fill(hints.points)
    anything = (hints.points[-1].weight.sum(dim=(2, 3), keepdim=True) > 0).to(filled[0].dtype)
    levels = [
        torch.cat(
            [
                normalised(dense) * anything,
                torch.log1p(points_level.weight),
                points_level.weight.clamp_max(1.0),
                normalised(ground_level.mean) * ground_level.weight,
                ground_level.weight,
            ],
            dim=1,
        )
        for dense, points_level, ground_level in zip(filled, hints.points, hints.ground, strict=True)
    ]
    measured = torch.cat([hints.points[0].mean, hints.points[0].weight, hints.ground[0].mean], dim=1)
    nearness = torch.cat([hints.ground[0].weight, *_nearness(hints)], dim=1)
    return HintLevels(levels, _summary(hints, anything), measured, nearness)


def normalised(log_q: Tensor) -> Tensor:
    """Log q as numbers around 0."""
    return (log_q - LOG_Q_MEAN) / LOG_Q_SPREAD


def _nearness(hints: HintPyramid) -> list[Tensor]:
    """(N, 1, h, w) each: weight of points in the cells around each pixel, at some levels."""
    maps = []
    for level in WEIGHT_LEVELS:
        weight = torch.log1p(hints.points[level].weight)
        for _ in range(level):
            weight = upsample(weight)
        maps.append(weight)
    return maps


def _summary(hints: HintPyramid, anything: Tensor) -> Tensor:
    """(N, 3, 1, 1) what the points say about the whole picture."""
    coarsest = hints.points[-1]
    weight = coarsest.weight.sum(dim=(2, 3), keepdim=True)
    mean = coarsest.total.sum(dim=(2, 3), keepdim=True) / weight.clamp_min(LEAST_WEIGHT)
    return torch.cat([normalised(mean) * anything, torch.log1p(weight) / COUNT_SCALE, anything], dim=1)
