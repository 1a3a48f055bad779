"""Metric depth of one picture."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class DepthMap:
    """Depth at the pixels of a camera.

    Args:
        depth_m: (H, W) float32, z-depth along the optical axis in metres; NaN where unknown,
            +inf where nothing stands (sky).
        relative_sigma: (H, W) float32, one standard deviation of depth over depth, or None if the
            source gives no uncertainty.
    """

    depth_m: NDArray[np.float32]
    relative_sigma: NDArray[np.float32] | None = None
