"""Networks that tell inverse depth up to scale and shift: both are fitted before anything is measured."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from uavdepth.camera import CameraModel
from uavdepth.depth.depth_map import DepthMap
from uavdepth.model.hints import PointHints

_ROUNDS = 4
_GATE = 3.0
"""Residuals beyond so many times their median size are left out of the next round."""

_FEWEST = 3


def fit_to_truth(
    affine_inverse_depth: NDArray[np.float32], truth_m: NDArray[np.float32]
) -> NDArray[np.float32] | None:
    """Depth at the scale and shift that fit the truth best, by least squares in inverse depth.

    The usual protocol for such networks (Ranftl et al. 2022, section 6); like median scaling it needs the
    truth, so no vehicle has it.

    Args:
        affine_inverse_depth: (H, W) float32 the network's answer, NaN where unknown.
        truth_m: (H, W) float32 z-depth in metres, NaN where not scored, +inf in the sky.

    Returns:
        (H, W) float32 z-depth, +inf where the fit puts a pixel beyond infinity; None where nothing fits.
    """
    with np.errstate(invalid="ignore"):
        usable = np.isfinite(affine_inverse_depth) & np.isfinite(truth_m) & (truth_m > 0)
    return _fitted(affine_inverse_depth, affine_inverse_depth[usable], truth_m[usable], rounds=1)


def fit_to_points(
    affine_inverse_depth: NDArray[np.float32], points: PointHints, camera: CameraModel
) -> NDArray[np.float32] | None:
    """Depth in metres at the scale and shift that fit points of known depth best, outliers left out.

    Args:
        affine_inverse_depth: (H, W) float32 the network's answer, NaN where unknown.
        points: in the camera's pixels.
        camera: of the picture.
    """
    limits = (camera.width - 1, camera.height - 1)
    column, row = np.clip(np.rint(points.pixels).astype(np.intp), 0, limits).T
    there = affine_inverse_depth[row, column]
    usable = np.isfinite(there)
    return _fitted(affine_inverse_depth, there[usable], points.depth_m[usable], _ROUNDS)


def _fitted(
    answer: NDArray[np.float32], values: NDArray[np.float32], depth_m: NDArray[np.float32], rounds: int
) -> NDArray[np.float32] | None:
    inverse = 1.0 / depth_m.astype(np.float64)
    kept = np.ones(values.shape, np.bool_)
    scale, shift = 0.0, 0.0
    for _ in range(rounds):
        if np.count_nonzero(kept) < _FEWEST:
            return None
        design = np.stack([values[kept].astype(np.float64), np.ones(np.count_nonzero(kept))], axis=1)
        scale, shift = np.linalg.lstsq(design, inverse[kept], rcond=None)[0].tolist()
        residual = np.abs(scale * values + shift - inverse)
        kept = residual <= _GATE * np.median(residual)
    if not scale > 0:
        return None
    depth = DepthMap.from_affine(answer).fitted(scale, shift).depth_m
    return np.where(np.isfinite(answer) & np.isnan(depth), np.float32(np.inf), depth).astype(np.float32)
