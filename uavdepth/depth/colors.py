"""Depth for eyes: lighter is nearer."""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from uavdepth.depth.codec import INVALID_CODE, NEARER_CODE, depth_codes

UNKNOWN_BGR = (112, 112, 112)
"""Grey: the colour map has no grey, so unknown is never mistaken for a distance."""


def colorize_depth(depth_m: NDArray[np.floating], near_m: float, far_m: float) -> NDArray[np.uint8]:
    """(H, W, 3) uint8 BGR picture of a depth map, logarithmic from near_m (lightest) to far_m (darkest).

    Args:
        depth_m: (H, W) depth in metres; NaN, zero and negative are drawn in `UNKNOWN_BGR`.
        near_m, far_m: span of the colours in metres; what lies outside takes the end colours.

    Raises:
        DepthCodecError: an impossible span or array, as in `encode_depth_png`.
    """
    codes = depth_codes(depth_m, near_m, far_m)
    return np.asarray(cv2.applyColorMap(codes, _color_table()), dtype=np.uint8)


@lru_cache(maxsize=1)
def _color_table() -> NDArray[np.uint8]:
    """(256, 1, 3) colour of each depth code. Inferno: perceptually even, light to dark in one direction."""
    lightness = np.arange(255, -1, -1, dtype=np.uint8).reshape(256, 1)
    table: NDArray[np.uint8] = np.array(cv2.applyColorMap(lightness, cv2.COLORMAP_INFERNO), dtype=np.uint8)
    table[NEARER_CODE] = table[NEARER_CODE + 1]
    table[INVALID_CODE] = UNKNOWN_BGR
    return table
