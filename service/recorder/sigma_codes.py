"""The uncertainty of depth in 8 bits: steps of 3.5 % from 0.1 % on, never more certain than it was."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

LEAST_SIGMA: Final = 0.001
STEPS_PER_DOUBLING: Final = 20
_UNKNOWN, _LEAST, _MOST = 0, 1, 255


def sigma_codes(relative_sigma: NDArray[np.float32]) -> NDArray[np.uint8]:
    """(H, W) uint8 codes c of standard deviations over depth, rounded up: sigma is 0.001 * 2^((c - 1) / 20).

    Code 0 is "not known", 255 is "6.6 or more".
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        steps = np.log2(np.maximum(relative_sigma, LEAST_SIGMA) / np.float32(LEAST_SIGMA))
    # A hair less, so that what a code stands for comes back as itself and not as the next one.
    codes = np.ceil(STEPS_PER_DOUBLING * steps - 1e-3) + _LEAST
    return np.where(np.isnan(codes), _UNKNOWN, np.clip(codes, _LEAST, _MOST)).astype(np.uint8)


def sigma_of_codes(codes: NDArray[np.uint8]) -> NDArray[np.float32]:
    """(H, W) float32 standard deviations over depth; NaN where not known, +inf for code 255."""
    table = LEAST_SIGMA * 2.0 ** ((np.arange(256) - _LEAST) / STEPS_PER_DOUBLING)
    table[_UNKNOWN], table[_MOST] = np.nan, np.inf
    return np.asarray(table.astype(np.float32)[codes])
