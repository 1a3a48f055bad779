"""Depth may jump where the picture does (Wei, Ding and Li 2025, equation 10; Godard et al. 2017)."""

from __future__ import annotations

import torch
from torch import Tensor

_TINY = 1e-7


def smoothness(disparity: Tensor, image: Tensor) -> Tensor:
    """Mean |grad D| exp(-|grad I|) over x plus that over y, a scalar.

    Args:
        disparity: (N, 1, H, W); divided by its mean over each picture first, so that shrinking gains nothing.
        image: (N, C, H, W) in 0..1; |grad I| is the mean over its channels.
    """
    scaled = disparity / (disparity.mean(dim=(2, 3), keepdim=True) + _TINY)
    total = disparity.new_zeros(())
    for dim in (2, 3):
        if disparity.shape[dim] > 1:
            edges = torch.diff(image, dim=dim).abs_().mean(dim=1, keepdim=True)
            total = total + (torch.diff(scaled, dim=dim).abs() * torch.exp(-edges)).mean()
    return total
