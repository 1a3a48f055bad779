"""One picture from a camera."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Frame:
    """A picture and when it was exposed.

    Args:
        image_bgr: (H, W, 3) uint8.
        captured_ns: capture time on the service's clock, nanoseconds.
        index: running number of the frame, from 0.
    """

    image_bgr: NDArray[np.uint8]
    captured_ns: int
    index: int
