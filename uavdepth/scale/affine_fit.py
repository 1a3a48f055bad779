"""Scale and shift of one network's affine inverse depth, from picture to picture."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from uavdepth.camera import CameraModel, CameraMount
from uavdepth.model.hints import GroundHint, PointHints
from uavdepth.scale.ground_scale import (
    MAX_PLANE_DEPTH_M,
    MIN_DEPRESSION,
    MIN_HEIGHT_M,
    GroundScale,
    GroundScaler,
)
from uavdepth.scale.points import LEAST_POINTS, sample
from uavdepth.scale.shape import AffineSamples, AffineShape, fit_affine
from uavdepth.scan.body_rays import body_rays

_COLUMNS = 32
_GROUND_SIGMA = 0.1
_GROUND_WORTH = 40.0
"""All of the ground is worth as much as so many points in tiles of their own."""

_FARTHEST_SHARE = 0.05


class AffineFit:
    """Fits the shape to points and to the ground.

    A level plane and any other are both linear in inverse depth, so with scale and shift free nearly all
    surfaces pass for the ground. The fit is therefore held against what it was not made of: nothing may lie
    beneath the ground, nor beyond infinity.

    Args:
        camera, mount: the camera and how it sits on the vehicle.
        scaler: says whether the ground is seen in fitted depth.
    """

    def __init__(self, camera: CameraModel, mount: CameraMount, scaler: GroundScaler) -> None:
        self.camera = camera
        self._scaler = scaler
        self._stride = max(1, round(camera.width / _COLUMNS))
        self._rays = body_rays(camera, mount, self._stride).reshape(3, -1)
        self.clear()

    def clear(self) -> None:
        """Forget everything."""
        self.shape: AffineShape | None = None
        self.ground: GroundScale | None = None
        """What the ground says of the last picture's fitted depth; None where it is not surely seen."""

    def update(
        self,
        values: NDArray[np.float32],
        ground: GroundHint | None,
        points: PointHints | None,
        passed_s: float,
    ) -> float:
        """Fit `shape` anew, and hear the ground; the shape stays None as long as nothing told it.

        Args:
            values: (H, W) affine inverse depth.
            ground: level ground at a known height, or None.
            points: measured points, or None.
            passed_s: time since the last picture.

        Returns:
            The log of the new shape's inverse depth over that of the shape before, at the pivot: the factor
            that makes up for it.
        """
        before = self.shape
        by_points = self._point_samples(values, points)
        samples = by_points
        if ground is not None:
            samples = by_points.with_more(self._ground_samples(values, ground))
        self.shape = fit_affine(samples, before, passed_s)
        self.ground = self._ground_scale(values, ground)
        if ground is not None and self.ground is None:
            # It tells no shape either: the fit makes a ground of most that is seen.
            self.shape = fit_affine(by_points, before, passed_s)
            self.ground = self._ground_scale(values, ground)
        if before is None or self.shape is None:
            return 0.0
        held = before.inverse_m(self.shape.network(self.shape.pivot))
        return math.log(self.shape.pivot / held) if held > 0 else 0.0

    def depth_m(self, values: NDArray[np.float32]) -> NDArray[np.float32]:
        """(H, W) depth by the shape; +inf beyond infinity, NaN where unknown.

        Raises:
            ValueError: nothing was fitted yet.
        """
        if self.shape is None:
            raise ValueError("no shape has been fitted yet")
        inverse = values * np.float32(self.shape.scale) + np.float32(self.shape.shift)
        with np.errstate(divide="ignore", over="ignore"):
            return np.asarray(1 / np.maximum(inverse, np.float32(0.0)))

    def _ground_scale(self, values: NDArray[np.float32], ground: GroundHint | None) -> GroundScale | None:
        if self.shape is None or ground is None:
            return None
        found = self._scaler.estimate(self.depth_m(values), ground.attitude, ground.height_m)
        if found is None:
            return None
        sigma = math.hypot(found.relative_sigma, self._beyond_infinity(values, self.shape))
        found = replace(found, relative_sigma=sigma)
        return found if found.is_sure else None

    def _beyond_infinity(self, values: NDArray[np.float32], shape: AffineShape) -> float:
        """By how much of the pivot's inverse depth the shift is too small at least: ground that rises ahead
        and is taken for level puts what is far off beyond infinity."""
        start = self._stride // 2
        sparse = values[start :: self._stride, start :: self._stride]
        sparse = np.sort(sparse[np.isfinite(sparse)])
        if not sparse.size:
            return 0.0
        farthest = float(sparse[int(_FARTHEST_SHARE * (sparse.size - 1))])
        return max(0.0, -shape.inverse_m(farthest)) / shape.pivot

    def _point_samples(self, values: NDArray[np.float32], points: PointHints | None) -> AffineSamples:
        if points is None or len(points) < LEAST_POINTS:
            nothing = np.empty(0)
            return AffineSamples(nothing, nothing, nothing, nothing)
        found = sample(values, points, self.camera, inverse=True)
        worth = 1.0 / np.maximum(np.bincount(found.tile)[found.tile], 4.0) * 4.0
        return AffineSamples(found.network, 1.0 / found.depth_m, found.sigma, worth)

    def _ground_samples(self, values: NDArray[np.float32], ground: GroundHint) -> AffineSamples:
        """The level ground's inverse depth at a grid of pixels that look down."""
        start = self._stride // 2
        network = values[start :: self._stride, start :: self._stride].ravel().astype(np.float64)
        down = ground.attitude.level_from_body[2] @ self._rays
        height_m = ground.camera_height_m
        looks = (down > MIN_DEPRESSION * np.linalg.norm(self._rays, axis=0)) & np.isfinite(network)
        if height_m < MIN_HEIGHT_M:
            looks[:] = False
        inverse = down[looks] / max(height_m, MIN_HEIGHT_M)
        near_enough = inverse > 1.0 / MAX_PLANE_DEPTH_M
        inverse, network = inverse[near_enough], network[looks][near_enough]
        worth = np.full(len(network), min(1.0, _GROUND_WORTH / max(len(network), 1)))
        return AffineSamples(network, inverse, np.full(len(network), _GROUND_SIGMA), worth)
