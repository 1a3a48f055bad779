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

from uavdepth.vehicle_motion import CameraMotion, MotionNoise

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
    """

    depth_m: Array
    relative_sigma: Array
    residual: Array
    parallax_rad: Array
    views: NDArray[np.intp]


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
    """Gauss-Newton on 6 M corrections and N inverse depths."""

    def __init__(
        self, rays: Array, seen: Array, motions: Sequence[CameraMotion], sigma: Array, noise: MotionNoise
    ) -> None:
        self.count, self.views = rays.shape[0], len(motions)
        self.points = np.concatenate([rays, np.ones((self.count, 1))], axis=1)
        self.there = ~np.isnan(seen[..., 0])
        self.seen = np.where(self.there[..., None], seen, 0.0)
        self.per_sigma = 1.0 / sigma[:, None, None]
        self.rotations = np.array([motion.rotation for motion in motions]).reshape(-1, 3, 3)
        self.offsets = np.array([motion.offset_m for motion in motions]).reshape(-1, 3)
        self.corrections = np.zeros((self.views, 6))
        self.prior = _prior(motions, noise)
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
            residual, pose, depth = residual * weight, pose * weight[..., None], depth * weight
        coupling, information, reduced = self._normal(pose, depth)
        flat = pose.reshape(self.views, -1, 6)
        gradient = np.sum(flat * residual.reshape(self.views, -1, 1), axis=1).ravel()
        gradient -= self.prior @ self.corrections.ravel()
        along = np.sum(depth * residual, axis=(0, 2))
        along += (_PRIOR_INVERSE_DEPTH - self.inverse) / _PRIOR_SIGMA**2
        change = np.linalg.solve(reduced, gradient - coupling.T @ (along / information))
        before, self.inverse = (
            self.inverse,
            _clipped(self.inverse + (along - coupling @ change) / information),
        )
        self.corrections += change.reshape(-1, 6)
        for view, turn in enumerate(change.reshape(-1, 6)[:, :3]):
            self.rotations[view] = cv2.Rodrigues(turn)[0] @ self.rotations[view]
        self.offsets += change.reshape(-1, 6)[:, 3:]
        return float(np.median(np.abs(self.inverse - before) / before))

    def result(self, here_sigma: float) -> Triangulation:
        """Depth, and its standard deviation from the inverse of the normal equations."""
        residual, pose, by_ray = self._linearised()
        rms = self._misfit(residual)
        weight = self._weight(residual)
        depth = self._along(by_ray) * weight
        coupling, information, reduced = self._normal(pose * weight[..., None], depth)
        gain = coupling / information[:, None]
        variance = 1.0 / information + np.sum((gain @ np.linalg.inv(reduced)) * gain, axis=1)
        # The ray in the newest view errs too, and the same way in the residuals of all other views.
        by_image = by_ray[..., :2] * (depth * weight)[..., None]
        shared = np.sum(by_image, axis=(0, 2)) / information[:, None]
        variance += np.sum(shared**2, axis=1) * here_sigma**2
        there = self.points + self.inverse[:, None] * self.offsets[:, None]
        dot = np.sum(self.points * there, axis=-1)
        lengths = np.sum(self.points**2, axis=-1) * np.sum(there**2, axis=-1)
        parallax = np.arccos(np.minimum(np.maximum(dot / np.sqrt(lengths), -1.0), 1.0))
        return Triangulation(
            1.0 / self.inverse,
            np.sqrt(variance) / self.inverse,
            rms,
            np.where(self.there, parallax, 0.0).max(axis=0, initial=0.0),
            self.there.sum(axis=0),
        )

    def _misfit(self, residual: Array) -> Array:
        """(N,) root mean square of a track's residuals over its degrees of freedom."""
        freedom = np.maximum(2 * self.there.sum(axis=0) - 1, 1)
        return np.asarray(np.sqrt(np.sum(residual**2, axis=(0, 2)) / freedom))

    def _weight(self, residual: Array) -> Array:
        """(N, 1) square root of the weight of each track."""
        misfit = self._misfit(residual)
        # While the attitudes are not corrected yet all tracks are off: the bar falls as they come to fit.
        bar = _KIND * max(1.0, float(np.median(misfit)))
        return np.asarray(1.0 / (1.0 + (misfit / bar) ** 2))[:, None]

    def _start(self) -> Array:
        """Inverse depth by linear least squares with the motions as given."""
        turned = self.points @ self.rotations.transpose(0, 2, 1)
        offset = self.offsets[:, None] @ self.rotations.transpose(0, 2, 1)
        # x (Z + rho tz) = X + rho tx, and the same in y.
        along = offset[..., :2] - self.seen * offset[..., 2:]
        wanted = self.seen * turned[..., 2:] - turned[..., :2]
        scale = np.where(self.there[..., None], self.per_sigma**2, 0.0)
        least = 1.0 / _PRIOR_SIGMA**2
        top = np.sum(scale * along * wanted, axis=(0, 2)) + least * _PRIOR_INVERSE_DEPTH
        return _clipped(top / (np.sum(scale * along**2, axis=(0, 2)) + least))

    def _linearised(self) -> tuple[Array, Array, Array]:
        """Residuals (M, N, 2), and their slopes by pose (M, N, 2, 6) and by ray (M, N, 2, 3), whitened."""
        inside = self.points + self.inverse[:, None] * self.offsets[:, None]
        point = inside @ self.rotations.transpose(0, 2, 1)
        ahead = self.there & (point[..., 2] > 0.05)
        z = np.where(ahead, point[..., 2], 1.0)
        image = point[..., :2] / z[..., None]
        scale = np.where(ahead, self.per_sigma[..., 0], 0.0)[..., None]
        u, v = image[..., :1], image[..., 1:]
        pose = np.empty((self.views, self.count, 2, 6))
        # d(u, v) by a small turn after the rotation.
        pose[..., 0, :3] = np.concatenate([-u * v, 1 + u * u, -v], axis=-1) * scale
        pose[..., 1, :3] = np.concatenate([-1 - v * v, u * v, u], axis=-1) * scale
        # d(u, v) by the point in the newest view's axes.
        turn = self.rotations[:, None, :2] - image[..., None] * self.rotations[:, None, 2:]
        by_ray = turn * (scale / z[..., None])[..., None]
        pose[..., 3:] = by_ray * self.inverse[:, None, None]
        return (self.seen - image) * scale, pose, by_ray

    def _along(self, by_ray: Array) -> Array:
        """Slope of the residuals by inverse depth, (M, N, 2)."""
        slope: Array = by_ray.reshape(self.views, -1, 3) @ self.offsets[..., None]
        return slope.reshape(self.views, -1, 2)

    def _normal(self, pose: Array, depth: Array) -> tuple[Array, Array, Array]:
        """Coupling (N, 6M), information of each inverse depth (N,), and the reduced matrix (6M, 6M)."""
        by_view = depth[..., :1] * pose[..., 0, :] + depth[..., 1:] * pose[..., 1, :]
        coupling = by_view.transpose(1, 0, 2).reshape(self.count, -1)
        information = np.sum(depth * depth, axis=(0, 2)) + 1.0 / _PRIOR_SIGMA**2
        whole = self.prior.copy()
        flat = pose.reshape(self.views, -1, 6)
        for view, block in enumerate(flat.transpose(0, 2, 1) @ flat):
            whole[6 * view : 6 * view + 6, 6 * view : 6 * view + 6] += block
        return coupling, information, whole - coupling.T @ (coupling / information[:, None])


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
