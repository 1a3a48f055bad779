"""Structural similarity over windows of 3 x 3 pixels (Wang et al. 2004), constants for images in 0..1."""

from __future__ import annotations

import torch.nn.functional as F  # noqa: N812 (torch's own convention)
from torch import Tensor

from training.photometric.constants import C1, C2


def ssim(first: Tensor, second: Tensor) -> Tensor:
    """Similarity of each pixel's neighbourhood, -1 to 1, of the shape of the pictures (N, C, H, W)."""
    mean_first, mean_second = box_mean(first), box_mean(second)
    variances = box_mean(first * first + second * second) - mean_first**2 - mean_second**2
    covariance = box_mean(first * second) - mean_first * mean_second
    numerator = (2.0 * mean_first * mean_second + C1) * (2.0 * covariance + C2)
    denominator = (mean_first**2 + mean_second**2 + C1) * (variances + C2)
    return numerator / denominator


def box_mean(values: Tensor) -> Tensor:
    """Mean over 3 x 3 windows, border pixels repeated outwards.

    Repeated rather than reflected borders make the filter its own adjoint, which the kernels rely on.
    """
    mean: Tensor = F.avg_pool2d(F.pad(values, (1, 1, 1, 1), mode="replicate"), 3, stride=1)
    return mean
