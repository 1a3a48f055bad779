"""How much rebuilt pictures differ from the real one (Wei, Ding and Li 2025, equation 9)."""

from __future__ import annotations

import torch
from torch import Tensor

from training.photometric.ssim import ssim


def photometric_error(rebuilt: Tensor, target: Tensor, alpha: float) -> Tensor:
    """alpha / 2 (1 - SSIM) + (1 - alpha) |I - J|, mean over the channels: (N, 1, H, W).

    Args:
        rebuilt, target: (N, C, H, W) in 0..1.
        alpha: share of structure, 0 to 1.
    """
    structure = 0.5 * alpha * (1.0 - ssim(rebuilt, target))
    return (structure + (1.0 - alpha) * (rebuilt - target).abs()).mean(dim=1, keepdim=True)


def over_sources(errors: Tensor, minimum: bool) -> Tensor:
    """One error for each pixel out of those of K sources, (K, ...): their minimum or their mean.

    What is hidden in one source is often seen in another: the minimum forgives it (Godard et al. 2019).
    """
    return torch.amin(errors, dim=0) if minimum else errors.mean(dim=0)
