"""Bilinear up-sampling as two matrix products."""

from __future__ import annotations

from functools import lru_cache

import torch
from torch import Tensor


def upsample(values: Tensor, height: int, width: int) -> Tensor:
    """(N, 1, height, width), equal to torch's bilinear interpolate with align_corners=False.

    Its gradient is another two products, some ten times faster on a processor than interpolate's scattering.

    Args:
        values: (N, 1, h, w).
        height, width: at least h and w.
    """
    if values.shape[-2:] == (height, width):
        return values
    rows = _weights(values.shape[-2], height, values.dtype, values.device)
    columns = _weights(values.shape[-1], width, values.dtype, values.device)
    return rows @ (values @ columns.T)


@lru_cache(maxsize=64)
def _weights(size: int, upsampled: int, dtype: torch.dtype, device: torch.device) -> Tensor:
    """(upsampled, size): what each new pixel takes of the old; shared, not to be written to."""
    # What the first validation left here must serve the training that follows.
    with torch.inference_mode(False):
        # The outer edges of the pictures coincide: a new centre x lies at (x + 1/2) size / upsampled - 1/2.
        place = (torch.arange(upsampled, dtype=torch.float64) + 0.5) * (size / upsampled) - 0.5
        place = place.clamp(0.0, size - 1.0)
        distance = place[:, None] - torch.arange(size, dtype=torch.float64)
        return (1.0 - distance.abs()).clamp_min(0.0).to(dtype=dtype, device=device)
