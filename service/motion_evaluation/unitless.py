"""Depth with its metres taken away, as networks give it that have none."""

from __future__ import annotations

import math
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from uavdepth.depth.depth_map import DepthMap

UNIT_M = 3.7
"""One unit of such depth."""

_EXPONENT = 0.95
"""Networks draw far things nearer than they are."""

_PATCH_SIGMA = 0.1
_PATCH_ROWS, _PATCH_COLUMNS = 4, 8
_PATCH_S = 2.0
"""Whole regions are off, and stay so for a while."""

_WANDER_PER_SQRT_S = 0.04
_AFFINE_SCALE, _AFFINE_SHIFT = 9.0, -0.2


class UnitlessTruth:
    """True depth as an imperfect network without metres would tell it.

    Args:
        kind: "relative": up to a factor that wanders; "affine": its inverse up to scale and
            shift.
        seed: of the errors.
    """

    def __init__(self, kind: Literal["relative", "affine"], seed: int = 0) -> None:
        self._kind = kind
        self._rng = np.random.default_rng([seed, 0x0EE])
        self._patches: NDArray[np.float64] | None = None
        self._wandered = 0.0

    def of(self, truth_m: NDArray[np.float32], passed_s: float) -> DepthMap:
        """The next picture's depth.

        Args:
            truth_m: (H, W) true depth, +inf sky, NaN unknown.
            passed_s: time since the picture before.
        """
        fresh = self._rng.normal(0, _PATCH_SIGMA, (_PATCH_ROWS, _PATCH_COLUMNS))
        keep = 0.0 if self._patches is None else math.exp(-passed_s / _PATCH_S)
        before = 0.0 if self._patches is None else self._patches
        self._patches = np.asarray(keep * before + math.sqrt(1 - keep**2) * fresh)
        self._wandered += self._rng.normal(0, _WANDER_PER_SQRT_S * math.sqrt(passed_s))
        size = truth_m.shape[1], truth_m.shape[0]
        field = cv2.resize(self._patches, size, interpolation=cv2.INTER_CUBIC)
        distance = np.minimum(truth_m, np.float32(200.0))
        log_depth = _EXPONENT * np.log(distance / 10.0) + field + math.log(10.0 / UNIT_M) + self._wandered
        if self._kind == "relative":
            return DepthMap(np.exp(log_depth).astype(np.float32))
        inverse = _AFFINE_SCALE * np.exp(-log_depth) + _AFFINE_SHIFT
        return DepthMap.from_affine(inverse.astype(np.float32))
