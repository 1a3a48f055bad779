"""Structural similarity over windows of 3 x 3 pixels (Wang et al. 2004), constants for images in 0..1."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor

C1 = 0.01**2
C2 = 0.03**2


def ssim(first: Tensor, second: Tensor) -> Tensor:
    """Similarity of each pixel's neighbourhood, -1 to 1, of the shape of the pictures (N, C, H, W)."""
    mean_first, mean_second = box_mean(first), box_mean(second)
    variances = box_mean(first * first + second * second) - mean_first**2 - mean_second**2
    covariance = box_mean(first * second) - mean_first * mean_second
    numerator = (2.0 * mean_first * mean_second + C1) * (2.0 * covariance + C2)
    denominator = (mean_first**2 + mean_second**2 + C1) * (variances + C2)
    return numerator / denominator


def box_mean(values: Tensor) -> Tensor:
    """Mean over 3 x 3 windows of the last two dimensions, border pixels repeated outwards."""
    mean: Tensor = _BoxMean.apply(values)  # type: ignore[no-untyped-call]
    return mean


def box_sum(values: Tensor) -> Tensor:
    """Sum over 3 x 3 windows, border pixels repeated outwards; not differentiable by itself.

    A few additions of whole pictures: avg_pool2d takes its nine taps one by one and is six times slower on a
    processor.
    """
    return _sum_down(_sum_across(values.contiguous()))


def _sum_across(values: Tensor) -> Tensor:
    # All rows as one long row add up faster than row by row; only the ends come out wrong and are redone.
    total = values.clone()
    flat, moved = total.view(-1), values.view(-1)
    flat[1:].add_(moved[:-1])
    flat[:-1].add_(moved[1:])
    for end, inner in ((0, 1), (-1, -2)):
        inner = inner if values.shape[-1] > 1 else end
        torch.add(values[..., inner], values[..., end], alpha=2.0, out=total[..., end])
    return total


def _sum_down(values: Tensor) -> Tensor:
    total = values.clone()
    total[..., 1:, :].add_(values[..., :-1, :])
    total[..., :-1, :].add_(values[..., 1:, :])
    total[..., 0, :].add_(values[..., 0, :])
    total[..., -1, :].add_(values[..., -1, :])
    return total


class _BoxMean(torch.autograd.Function):
    """With repeated borders the filter's matrix is symmetric: its gradient is the filter itself."""

    @staticmethod
    def forward(ctx: Any, values: Tensor) -> Tensor:
        return box_sum(values).mul_(1.0 / 9.0)

    @staticmethod
    def backward(ctx: Any, gradient: Tensor) -> Tensor:
        return box_sum(gradient).mul_(1.0 / 9.0)
