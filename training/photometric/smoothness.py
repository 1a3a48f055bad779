"""Depth may jump where the picture does (Wei, Ding and Li 2025, equation 10; Godard et al. 2017)."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor
from torch.autograd.function import once_differentiable

_TINY = 1e-7


def smoothness(disparity: Tensor, image: Tensor) -> Tensor:
    """Mean |grad D| exp(-|grad I|) over x plus that over y, a scalar.

    Args:
        disparity: (N, 1, H, W); divided by its mean over each picture first, so that shrinking gains nothing.
        image: (N, C, H, W) in 0..1; |grad I| is the mean over its channels. Gets no gradient.
    """
    variation: Tensor = _EdgeAwareVariation.apply(disparity, image)  # type: ignore[no-untyped-call]
    return (variation / (disparity.mean(dim=(1, 2, 3)) + _TINY)).mean()


class _EdgeAwareVariation(torch.autograd.Function):
    """(N,) sums over both directions of mean |grad d| exp(-|grad I|), each with its derivative at once."""

    @staticmethod
    def forward(ctx: Any, disparity: Tensor, image: Tensor) -> Tensor:
        gradient = torch.zeros_like(disparity)
        total = disparity.new_zeros(len(disparity))
        for dim in (2, 3):
            size = disparity.shape[dim] - 1
            if size == 0:
                continue
            edges = torch.diff(image, dim=dim).abs_().mean(dim=1, keepdim=True)
            weight = torch.exp(edges.neg_()).mul_(1.0 / (size * disparity.shape[5 - dim]))
            step = torch.diff(disparity, dim=dim)
            total += (step.abs() * weight).sum(dim=(1, 2, 3))
            pull = step.sign_().mul_(weight)
            gradient.narrow(dim, 1, size).add_(pull)
            gradient.narrow(dim, 0, size).sub_(pull)
        ctx.save_for_backward(gradient)
        return total

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, by_total: Tensor) -> tuple[Tensor, None]:
        (gradient,) = ctx.saved_tensors
        return gradient * by_total[:, None, None, None], None
