"""Exact depth in 16-bit pictures: logarithmic, 0.015 % a step, sky kept apart."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

NEAR_M = 0.1
FAR_M = 4000.0
SKY_CODE = 0
_STEPS = 65534
_SCALE = _STEPS / math.log(FAR_M / NEAR_M)


def encode_depth16(depth_m: NDArray[np.float32]) -> NDArray[np.uint16]:
    """Codes 1 to 65535 for 0.1 m to 4 km (clamped), 0 for anything that is not finite (sky)."""
    finite = np.isfinite(depth_m)
    clamped = np.clip(np.where(finite, depth_m, FAR_M), NEAR_M, FAR_M)
    codes = 1 + np.rint(np.log(clamped / NEAR_M) * _SCALE)
    return np.where(finite, codes, SKY_CODE).astype(np.uint16)


def decode_depth16(codes: NDArray[np.uint16]) -> NDArray[np.float32]:
    """Depth in metres, +inf for sky."""
    depth = NEAR_M * np.exp((codes.astype(np.float32) - 1) / np.float32(_SCALE))
    return np.where(codes == SKY_CODE, np.float32(np.inf), depth).astype(np.float32)
