"""Depth of points seen from several places: weighted least squares over all views at once.

The unknowns are the points' inverse depths and, held by what the autopilot knows of them, small corrections
of each view's attitude and place. Some hundred points say far better than an attitude of half a degree how
two pictures are turned against each other; how far they lie apart only the autopilot knows, and its doubt
goes into every point. Inverse depth anchored in the newest picture: Civera, Davison and Montiel (2008),
"Inverse Depth Parametrization for Monocular SLAM". Normal equations with the points eliminated, and the
covariance from them: Hartley and Zisserman, "Multiple View Geometry", 2nd edition, appendix A6.3 and
section 5.2; weights of the residuals: A6.8.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from uavdepth.motion.vehicle_motion import CameraMotion, MotionNoise

Array = NDArray[np.float64]

_ITERATIONS = 8
_CONVERGED = 0.002
"""Median change of inverse depth, relative, at which the iterations end."""

_PLAIN_ITERATIONS = 2
"""Before them no residual is called an outlier: the attitudes are not corrected yet."""

_KIND = 2.0
"""Tracks whose residual is beyond it, in standard deviations, count less and less (Geman and McClure, 1985):
it is whole tracks that are wrong, since what moves is wrong in all views."""

_PRIOR_INVERSE_DEPTH = 0.05
_PRIOR_SIGMA = 0.5
"""Before it is measured, a point lies somewhere from 2 m to infinity."""

_NEAREST, _FARTHEST = 1 / 0.3, 1 / 500.0
_SHARED_ERROR = 0.8
"""Share of the variance of the offsets that all views have in common: velocity errors last."""

_LEAST_OFFSET_SIGMA_M = 0.002


@dataclass(frozen=True, eq=False)
class Triangulation:
    """Depth of N points in the newest view.

    Args:
        depth_m: (N,) z-depth, metres.
        relative_sigma: (N,) one standard deviation of depth over depth.
        residual: (N,) root mean square of the re-projection errors, in standard deviations of a pixel's.
        parallax_rad: (N,) largest angle between the newest and another ray to the point.
        views: (N,) other views that saw the point.
        rotations: (M, 3, 3) from the newest view's axes into each other view's, as the points show them.
    """

    depth_m: Array
    relative_sigma: Array
    residual: Array
    parallax_rad: Array
    views: NDArray[np.intp]
    rotations: Array


def triangulate(
    rays: Array,
    seen: Array,
    motions: Sequence[CameraMotion],
    sigma: Array,
    noise: MotionNoise,
    here_sigma: float,
) -> Triangulation:
    """Depth of points from where they were seen.

    Points that no other view saw, or that the views do not agree on, come back with what was found:
    it is the caller who rejects by residual, sigma and parallax.

    Args:
        rays: (N, 2) normalised x, y of the points in the newest view.
        seen: (M, N, 2) the same in M other views, NaN where a view did not see the point.
        motions: M motions from the newest view to each of them.
        sigma: (M,) one standard deviation of `seen`, in the same unit (pixels over focal length).
        noise: of the attitude.
        here_sigma: one standard deviation of `rays`.

    Returns:
        One result a point.
    """
    solver = _Solver(rays, seen, motions, sigma, noise)
    for number in range(_ITERATIONS):
        kind = number >= _PLAIN_ITERATIONS
        if solver.step(kind) < _CONVERGED and kind:
            break
    return solver.result(here_sigma)


class _Solver:
    """Gauss-Newton on 6 M corrections and N inverse depths.

    Arrays run over views, then axes, then points: numpy is quick along the last axis only.
    """

    def __init__(
        self, rays: Array, seen: Array, motions: Sequence[CameraMotion], sigma: Array, noise: MotionNoise
    ) -> None:
        self.count, self.views = rays.shape[0], len(motions)
        self.points = np.concatenate([rays.T, np.ones((1, self.count))])
        self.there = ~np.isnan(seen[..., 0])
        self.seen = np.where(self.there[:, None], seen.transpose(0, 2, 1), 0.0)
        self.per_sigma = np.where(self.there, 1.0 / sigma[:, None], 0.0)
        self.rotations = np.array([motion.rotation for motion in motions]).reshape(-1, 3, 3)
        self.offsets = np.array([motion.offset_m for motion in motions]).reshape(-1, 3)
        self.corrections = np.zeros((self.views, 6))
        self.prior = _prior(motions, noise)
        self.freedom = np.maximum(2 * self.there.sum(axis=0) - 1, 1)
        self.inverse = self._start()

    def step(self, kind: bool) -> float:
        """One iteration; a kind one weighs tracks down that are too far off for noise.

        Returns:
            The median change of the inverse depths, as a share of their own.
        """
        residual, pose, by_ray = self._linearised()
        depth = self._along(by_ray)
        if kind:
            weight = self._weight(residual)
            residual, pose, depth = residual * weight, pose * weight, depth * weight
        coupling, information, reduced = self._normal(pose, depth)
        flat = pose.reshape(self.views, 6, -1)
        gradient = (flat @ residual.reshape(self.views, -1, 1)).ravel()
        gradient -= self.prior @ self.corrections.ravel()
        along = np.einsum("van,van->n", depth, residual)
        along += (_PRIOR_INVERSE_DEPTH - self.inverse) / _PRIOR_SIGMA**2
        change = np.linalg.solve(reduced, gradient - coupling @ (along / information))
        before, self.inverse = (
            self.inverse,
            _clipped(self.inverse + (along - change @ coupling) / information),
        )
        self.corrections += change.reshape(-1, 6)
        for view, turn in enumerate(change.reshape(-1, 6)[:, :3]):
            self.rotations[view] = cv2.Rodrigues(turn)[0] @ self.rotations[view]
        self.offsets += change.reshape(-1, 6)[:, 3:]
        return _upper_median(np.abs(self.inverse / before - 1.0))

    def result(self, here_sigma: float) -> Triangulation:
        """Depth, and its standard deviation from the inverse of the normal equations."""
        residual, pose, by_ray = self._linearised()
        rms = self._misfit(residual)
        weight = self._weight(residual)
        depth = self._along(by_ray) * weight
        coupling, information, reduced = self._normal(pose * weight, depth)
        gain = coupling / information
        variance = 1.0 / information + np.einsum("kn,kn->n", np.linalg.inv(reduced) @ gain, gain)
        # The ray in the newest view errs too, and the same way in the residuals of all other views.
        shared = np.einsum("vaxn,van->xn", by_ray[:, :, :2], depth * weight) / information
        variance += np.sum(shared**2, axis=0) * here_sigma**2
        there = self._inside()
        dot = np.einsum("xn,vxn->vn", self.points, there)
        lengths = np.sum(self.points**2, axis=0) * np.einsum("vxn,vxn->vn", there, there)
        parallax = np.arccos(np.minimum(np.maximum(dot / np.sqrt(lengths), -1.0), 1.0))
        return Triangulation(
            1.0 / self.inverse,
            np.sqrt(variance) / self.inverse,
            rms,
            np.where(self.there, parallax, 0.0).max(axis=0, initial=0.0),
            self.there.sum(axis=0),
            self.rotations,
        )

    def _misfit(self, residual: Array) -> Array:
        """(N,) root mean square of a track's residuals over its degrees of freedom."""
        return np.asarray(np.sqrt(np.einsum("van,van->n", residual, residual) / self.freedom))

    def _weight(self, residual: Array) -> Array:
        """(N,) square root of the weight of each track."""
        misfit = self._misfit(residual)
        # While the attitudes are not corrected yet all tracks are off: the bar falls as they come to fit.
        bar = _KIND * max(1.0, _upper_median(misfit))
        return np.asarray(1.0 / (1.0 + (misfit / bar) ** 2))

    def _start(self) -> Array:
        """Inverse depth by linear least squares with the motions as given."""
        turned = self.rotations @ self.points
        offset = (self.rotations @ self.offsets[..., None])[:, :, 0]
        # x (Z + rho tz) = X + rho tx, and the same in y.
        along = offset[:, :2, None] - self.seen * offset[:, 2:, None]
        wanted = self.seen * turned[:, 2:] - turned[:, :2]
        scale = self.per_sigma[:, None] ** 2
        least = 1.0 / _PRIOR_SIGMA**2
        top = np.sum(scale * along * wanted, axis=(0, 1)) + least * _PRIOR_INVERSE_DEPTH
        return _clipped(top / (np.sum(scale * along**2, axis=(0, 1)) + least))

    def _inside(self) -> Array:
        """(M, 3, N) the points seen from each view, in the newest view's axes, over their depth."""
        return np.asarray(self.points + self.offsets[:, :, None] * self.inverse)

    def _linearised(self) -> tuple[Array, Array, Array]:
        """Residuals (M, 2, N), and their slopes by pose (M, 6, 2, N) and by ray (M, 2, 3, N), whitened."""
        point = self.rotations @ self._inside()
        ahead = point[:, 2] > 0.05
        per_z = 1.0 / np.where(ahead, point[:, 2], 1.0)
        scale = np.where(ahead, self.per_sigma, 0.0)
        u, v = point[:, 0] * per_z, point[:, 1] * per_z
        su, sv = scale * u, scale * v
        pose = np.empty((self.views, 6, 2, self.count))
        # d(u, v) by a small turn after the rotation.
        np.negative(su * v, out=pose[:, 0, 0])
        np.add(scale, su * u, out=pose[:, 1, 0])
        np.negative(sv, out=pose[:, 2, 0])
        np.subtract(-scale, sv * v, out=pose[:, 0, 1])
        np.negative(pose[:, 0, 0], out=pose[:, 1, 1])
        pose[:, 2, 1] = su
        # d(u, v) by the point in the newest view's axes.
        image = np.stack([u, v], axis=1)
        turn = self.rotations[:, :2, :, None] - image[:, :, None] * self.rotations[:, 2:, :, None]
        by_ray = turn * (scale * per_z)[:, None, None]
        np.multiply(by_ray.transpose(0, 2, 1, 3), self.inverse, out=pose[:, 3:])
        return (self.seen - image) * scale[:, None], pose, by_ray

    def _along(self, by_ray: Array) -> Array:
        """Slope of the residuals by inverse depth, (M, 2, N)."""
        return np.asarray(np.einsum("vaxn,vx->van", by_ray, self.offsets))

    def _normal(self, pose: Array, depth: Array) -> tuple[Array, Array, Array]:
        """Coupling (6M, N), information of each inverse depth (N,), and the reduced matrix (6M, 6M)."""
        coupling = (pose[:, :, 0] * depth[:, None, 0] + pose[:, :, 1] * depth[:, None, 1]).reshape(
            6 * self.views, -1
        )
        information = np.einsum("van,van->n", depth, depth) + 1.0 / _PRIOR_SIGMA**2
        whole = self.prior.copy()
        flat = pose.reshape(self.views, 6, -1)
        for view, block in enumerate(flat @ flat.transpose(0, 2, 1)):
            whole[6 * view : 6 * view + 6, 6 * view : 6 * view + 6] += block
        return coupling, information, whole - (coupling / information) @ coupling.T


def _upper_median(values: Array) -> float:
    """A quarter of the time of numpy's, whose checks cost more than its work here."""
    middle = values.size // 2
    return float(np.partition(values, middle)[middle])


def _clipped(inverse: Array) -> Array:
    return np.minimum(np.maximum(inverse, _FARTHEST), _NEAREST)


def _prior(motions: Sequence[CameraMotion], noise: MotionNoise) -> Array:
    """(6M, 6M) information on the corrections: of the turn and of the offset, view by view."""
    count = len(motions)
    # Attitudes are against the newest one's, whose error all views share.
    turn = noise.attitude_rad**2 * (np.eye(count) + np.ones((count, count)))
    spread = np.array([max(motion.sigma_m, _LEAST_OFFSET_SIGMA_M) for motion in motions])
    reach = noise.attitude_rad * np.array([motion.baseline_m for motion in motions])
    offset = (
        _SHARED_ERROR * np.outer(spread, spread)
        + (1 - _SHARED_ERROR) * np.diag(spread**2)
        + np.outer(reach, reach)
    )
    prior = np.zeros((count, 6, count, 6))
    for axes, covariance in ((range(3), turn), (range(3, 6), offset)):
        information = np.linalg.inv(covariance)
        for axis in axes:
            prior[:, axis, :, axis] = information
    return prior.reshape(6 * count, 6 * count)
