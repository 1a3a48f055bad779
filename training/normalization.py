"""How pictures and depths become what the network sees and says."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

IMAGE_MEAN = (127.0 / 255.0,) * 3
IMAGE_STD = (128.0 / 255.0,) * 3
"""Of RGB in 0..1: the values that EfficientNet-Lite was trained with."""

FOCAL_REFERENCE_PX = 230.0
"""Horizontal focal length that outputs are normalised to: 80 degrees of view at a width of 384."""

MAX_DEPTH_M = 200.0
"""Depth that the network is taught to reach; sky and whatever is farther counts as at least that."""


def log_inverse_depth(depth_m: NDArray[np.float32], fx_px: float) -> NDArray[np.float32]:
    """The network's word for a depth in metres, seen with `fx_px` pixels of focal length at its own width.

    Depth beyond `MAX_DEPTH_M`, sky included, becomes that of `MAX_DEPTH_M`.
    """
    clamped = np.clip(depth_m, 0.05, MAX_DEPTH_M)
    return (math.log(fx_px / FOCAL_REFERENCE_PX) - np.log(clamped)).astype(np.float32)


def depth_from_output(output: NDArray[np.float32], fx_px: float) -> NDArray[np.float32]:
    """Metres from the network's word; the inverse of `log_inverse_depth`."""
    return np.asarray(np.exp(math.log(fx_px / FOCAL_REFERENCE_PX) - output), np.float32)
