"""Errors of metric depth pictures, and of their scale."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

FARTHEST_M = 80.0
"""As the evaluations of KITTI do (Eigen et al., 2014)."""

NEAREST_M = 0.5
_SCALE_FARTHEST_M = 40.0
"""The scale is asked for where obstacles are."""

_LEAST_PIXELS = 200


def abs_rel(depth_m: NDArray[np.float32], truth_m: NDArray[np.float32]) -> float:
    """Mean of |depth - truth| / truth over pixels whose truth is known; NaN where too few are.

    Nothing is scaled. Depth is clipped to the evaluated range; unknown depth is left out.
    """
    known = np.isfinite(truth_m) & (truth_m >= NEAREST_M) & (truth_m <= FARTHEST_M) & np.isfinite(depth_m)
    if np.count_nonzero(known) < _LEAST_PIXELS:
        return math.nan
    depth = np.clip(depth_m[known].astype(np.float64), NEAREST_M, FARTHEST_M)
    truth = truth_m[known].astype(np.float64)
    return float(np.mean(np.abs(depth - truth) / truth))


def log_scale(depth_m: NDArray[np.float32], truth_m: NDArray[np.float32]) -> float:
    """Log of the median of depth over truth: 0 where the scale is right; NaN where too few pixels tell."""
    known = np.isfinite(truth_m) & (truth_m >= NEAREST_M) & (truth_m <= _SCALE_FARTHEST_M)
    known &= np.isfinite(depth_m) & (depth_m > 0)
    if np.count_nonzero(known) < _LEAST_PIXELS:
        return math.nan
    return float(np.median(np.log(depth_m[known].astype(np.float64) / truth_m[known])))
