"""Metric depth of one picture."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class DepthMap:
    """Depth at the pixels of a camera.

    A network that tells depth up to one factor gives it in units of its own: `ScaleEstimator` finds the
    factor. A network that tells inverse depth up to scale and shift has no depth at all until both are
    found: then `depth_m` is NaN everywhere, so that nobody takes its numbers for metres, and `fitted`
    makes depth of `affine_inverse_depth`.

    Args:
        depth_m: (H, W) float32, z-depth along the optical axis in metres; NaN where unknown,
            +inf where nothing stands (sky).
        relative_sigma: (H, W) float32, one standard deviation of depth over depth, or None if the
            source gives no uncertainty.
        affine_inverse_depth: (H, W) float32, numbers that an unknown scale and shift make inverse depth
            of, larger nearer; NaN where unknown. None for every other source.
    """

    depth_m: NDArray[np.float32]
    relative_sigma: NDArray[np.float32] | None = None
    affine_inverse_depth: NDArray[np.float32] | None = None

    @property
    def believed_m(self) -> NDArray[np.float32]:
        """(H, W) `depth_m` as it may be shown: NaN also where its uncertainty is not finite."""
        if self.relative_sigma is None:
            return self.depth_m
        return np.where(np.isfinite(self.relative_sigma), self.depth_m, np.float32(np.nan))

    @classmethod
    def from_affine(cls, affine_inverse_depth: NDArray[np.float32]) -> DepthMap:
        """Depth that is not known yet, of inverse depth up to scale and shift."""
        return cls(np.full_like(affine_inverse_depth, np.nan), None, affine_inverse_depth)

    def fitted(self, scale_per_m: float, shift_per_m: float) -> DepthMap:
        """Depth in metres, 1 / (scale_per_m * affine_inverse_depth + shift_per_m).

        Args:
            scale_per_m: inverse metres for each unit of `affine_inverse_depth`, above 0.
            shift_per_m: inverse metres where that is 0.

        Returns:
            Depth, NaN where the fit puts a pixel beyond infinity.

        Raises:
            ValueError: a depth map that is not affine, or a fit that is not finite or turns near and far
                round.
        """
        if self.affine_inverse_depth is None:
            raise ValueError("this depth map needs no fit: it does not come from an affine network")
        if not (math.isfinite(scale_per_m) and math.isfinite(shift_per_m) and scale_per_m > 0):
            raise ValueError(
                f"the fit is {scale_per_m}, {shift_per_m}: finite numbers and a scale above 0 are needed"
            )
        inverse = self.affine_inverse_depth * np.float32(scale_per_m) + np.float32(shift_per_m)
        with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
            depth_m = np.where(inverse > 0, 1 / inverse, np.nan).astype(np.float32)
        depth_m[~np.isfinite(depth_m)] = np.nan
        return DepthMap(depth_m)
