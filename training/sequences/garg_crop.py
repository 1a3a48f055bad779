"""The part of KITTI's pictures that depth is measured on."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

GARG_ROWS = (0.40810811, 0.99189189)
GARG_COLUMNS = (0.03594771, 0.96405229)
"""Shares of the picture's height and width (Garg et al. 2016, used with the Eigen split ever since)."""


def garg_mask(height: int, width: int) -> NDArray[np.bool_]:
    """(height, width) mask that is true inside the crop; bounds are cut down to whole pixels."""
    mask = np.zeros((height, width), bool)
    top, bottom = (int(share * height) for share in GARG_ROWS)
    left, right = (int(share * width) for share in GARG_COLUMNS)
    mask[top:bottom, left:right] = True
    return mask
