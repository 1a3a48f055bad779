"""Depth may jump where the picture does (Wei, Ding and Li 2025, equation 10; Godard et al. 2017)."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor
from torch.autograd.function import once_differentiable

from training.photometric.kernel_choice import kernels_for, planes

_TINY = 1e-7


def smoothness(disparity: Tensor, image: Tensor) -> Tensor:
    """Mean |grad D| exp(-|grad I|) over x plus that over y, a scalar.

    Args:
        disparity: (N, 1, H, W); divided by its mean over each picture first, so that shrinking gains nothing.
        image: (N, C, H, W) in 0..1; |grad I| is the mean over its channels. Gets no gradient.
    """
    if kernels_for(disparity) is None:
        variation = edge_aware_variation(disparity, image)
    else:
        variation = _Variation.apply(disparity, image)  # type: ignore[no-untyped-call]
    return (variation / (disparity.mean(dim=(1, 2, 3)) + _TINY)).mean()


def edge_aware_variation(disparity: Tensor, image: Tensor) -> Tensor:
    """(N,) the same of a disparity as it is."""
    total = disparity.new_zeros(len(disparity))
    for dim in (2, 3):
        if disparity.shape[dim] > 1:
            edges = torch.diff(image.detach(), dim=dim).abs().mean(dim=1, keepdim=True)
            total = total + (torch.diff(disparity, dim=dim).abs() * torch.exp(-edges)).mean(dim=(1, 2, 3))
    return total


class _Variation(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, disparity: Tensor, image: Tensor) -> Tensor:
        kernels = kernels_for(disparity)
        if kernels is None:
            raise RuntimeError("the kernels were chosen but did not load")
        by_disparity = torch.empty_like(disparity, memory_format=torch.contiguous_format)
        pictures = zip(planes(disparity[:, 0]), planes(image), by_disparity[:, 0].numpy(), strict=True)
        total = disparity.new_tensor([kernels.variation(*picture) for picture in pictures])
        ctx.save_for_backward(by_disparity)
        return total

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, by_total: Tensor) -> tuple[Tensor, None]:
        (by_disparity,) = ctx.saved_tensors
        return by_disparity * by_total[:, None, None, None], None
