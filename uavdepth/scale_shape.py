"""Scale and shift of inverse depth: how a network's affine answer becomes metres."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_TRIALS = 120
_GATE = 0.25
"""Relative error of depth beyond which a sample says nothing for a trial."""

_ITERATIONS = 8
_TUKEY = 4.685
_NARROWEST = 0.03
_NETWORK_SCATTER = 0.1
_LEAST_SAMPLES = 8
_LEAST_SUPPORT = 0.3
_LARGEST_SIGMA = 0.3
"""Relative sigma of depth at the nearer and the farther end of the samples beyond which nothing was fitted:
they lie at one depth, which tells one number of two."""

_WANDER_PER_SQRT_S = 0.08
"""Relative sigma of depth at both ends that a fit gains by the square root of a second."""


@dataclass(frozen=True, eq=False)
class AffineSamples:
    """Pixels whose inverse depth is known.

    Args:
        network: (N,) the network's affine inverse depth.
        inverse_m: (N,) 1 / metres, above 0.
        sigma: (N,) relative standard deviation of it.
        worth: (N,) weight of each; so much less than 1 as neighbours say the same.
    """

    network: Array
    inverse_m: Array
    sigma: Array
    worth: Array

    def with_more(self, other: AffineSamples) -> AffineSamples:
        """Both sources together."""
        names = ("network", "inverse_m", "sigma", "worth")
        return AffineSamples(*(np.concatenate([getattr(self, n), getattr(other, n)]) for n in names))


@dataclass(frozen=True, eq=False)
class AffineShape:
    """1 / depth_m = scale * network + shift.

    Args:
        scale, shift: 1 / metres for each unit of the network, and at its 0.
        covariance: (2, 2) of both.
        near, far: the network's values between which samples lay (far is the smaller one).
        pivot: the middle one.
    """

    scale: float
    shift: float
    covariance: Array
    near: float
    far: float
    pivot: float

    def inverse_m(self, network: float) -> float:
        """1 / metres."""
        return self.scale * network + self.shift

    def relative(self) -> Array:
        """(2, 2) covariance of scale and shift when depth at the pivot is taken as exact."""
        theta = np.array([self.scale, self.shift])
        keep = np.eye(2) - np.outer(theta, [self.pivot, 1.0]) / self.inverse_m(self.pivot)
        return np.asarray(keep @ self.covariance @ keep.T)


def fit_affine(samples: AffineSamples, before: AffineShape | None, passed_s: float) -> AffineShape | None:
    """Scale and shift that most samples agree on, held by the fit of the picture before.

    Random sample consensus (Fischler and Bolles, 1981) over pairs, then Tukey's biweight on relative errors
    of inverse depth. The trials are the same for the same samples.

    Args:
        samples: of one picture.
        before: the fit of the picture before.
        passed_s: time since it.

    Returns:
        None where samples are few, agree on nothing, or lie at one depth and nothing was fitted before.
    """
    known = np.isfinite(samples.network) & np.isfinite(samples.inverse_m) & (samples.inverse_m > 0)
    a, q = samples.network[known], samples.inverse_m[known]
    weight = samples.worth[known] / (samples.sigma[known] ** 2 + _NETWORK_SCATTER**2)
    if len(a) < _LEAST_SAMPLES:
        return before
    start = _consensus(a, q, weight, before)
    if start is None:
        return before
    prior, expected = _prior(before, passed_s)
    theta, information = start, prior
    rows = np.stack([a, np.ones_like(a)], axis=1) / q[:, None]
    robust = weight
    for _ in range(_ITERATIONS):
        distance = np.abs(rows @ theta - 1.0)
        inside = distance < 2 * _GATE
        if not inside.any():
            return before
        scatter = max(1.4826 * float(np.median(distance[inside])), _NARROWEST)
        share = np.minimum(distance / (_TUKEY * scatter), 1.0)
        # The weights count errors of one scatter, not of the samples' own sigma, where that is less.
        robust = weight * (1 - share**2) ** 2
        robust = robust * min(1.0, (_NETWORK_SCATTER / scatter) ** 2)
        information = prior + (rows * robust[:, None]).T @ rows
        if np.linalg.cond(information) > 1e14:
            return before
        theta, last = (
            np.linalg.solve(information, prior @ expected + rows.T @ robust),
            theta,
        )
        if np.abs(rows @ (theta - last)).max() < 1e-3:
            break
    support = robust > 0.1 * weight
    if theta[0] <= 0 or np.sum(weight[support]) < _LEAST_SUPPORT * np.sum(weight):
        return before
    far, pivot, near = (float(each) for each in np.quantile(a[support], [0.05, 0.5, 0.95]))
    shape = AffineShape(float(theta[0]), float(theta[1]), np.linalg.inv(information), near, far, pivot)
    if any(shape.inverse_m(value) <= 0 or _sigma(shape, value) > _LARGEST_SIGMA for value in (near, far)):
        return before
    if before is not None:
        # What was known of nearer and farther things stays known.
        shape = AffineShape(
            shape.scale, shape.shift, shape.covariance, max(near, pivot), min(far, pivot), pivot
        )
    return shape


def _sigma(shape: AffineShape, network: float) -> float:
    """Relative standard deviation of depth at a value of the network."""
    row = np.array([network, 1.0])
    return math.sqrt(max(float(row @ shape.covariance @ row), 0.0)) / abs(shape.inverse_m(network))


def _prior(before: AffineShape | None, passed_s: float) -> tuple[Array, Array]:
    """Information (2, 2) and expected scale and shift."""
    if before is None:
        return np.zeros((2, 2)), np.zeros(2)
    ends = np.array([[before.near, 1.0], [before.far, 1.0]])
    theta = np.array([before.scale, before.shift])
    if abs(before.near - before.far) < 1e-9:
        return np.zeros((2, 2)), np.zeros(2)
    drift = (ends @ theta) ** 2 * (_WANDER_PER_SQRT_S**2 * max(passed_s, 1e-3))
    back = np.linalg.inv(ends)
    covariance = before.covariance + back @ np.diag(drift) @ back.T
    return np.asarray(np.linalg.inv(covariance)), theta


def _consensus(a: Array, q: Array, weight: Array, before: AffineShape | None) -> Array | None:
    """Scale and shift of the best pair of samples, or of the picture before."""
    rng = np.random.default_rng(0)
    chance = np.cumsum(weight) / weight.sum()
    pair = np.minimum(np.searchsorted(chance, rng.random((_TRIALS, 2))), len(a) - 1)
    first, second = pair.T
    apart = a[first] - a[second]
    with np.errstate(divide="ignore", invalid="ignore"):
        scale = (q[first] - q[second]) / apart
    shift = q[first] - scale * a[first]
    trials = np.stack([scale, shift], axis=1)[np.isfinite(scale) & (scale > 0)]
    if before is not None:
        trials = np.concatenate([trials, [[before.scale, before.shift]]])
    if not len(trials):
        return None
    off = np.abs((trials[:, :1] * a + trials[:, 1:]) / q - 1.0)
    score = np.maximum(1.0 - (off / _GATE) ** 2, 0.0) @ weight
    return np.asarray(trials[int(np.argmax(score))])
