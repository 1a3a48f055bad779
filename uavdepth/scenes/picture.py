"""One rendered frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class RenderedPicture:
    """A picture and its exact depth.

    Args:
        image_bgr: (H, W, 3) uint8.
        depth_m: (H, W) float32 depth along the optical axis of each pixel's centre, +inf in the sky.
    """

    image_bgr: NDArray[np.uint8]
    depth_m: NDArray[np.float32]
