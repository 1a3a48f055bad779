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

_LEAST_SLOPE_SIGMAS = 3.0
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
    """network = slope / depth_m + level: the network's answer as it follows from depth.

    Args:
        slope, level: network's unit times metres, and the network's answer infinitely far away.
        covariance: (2, 2) of both.
        near, far: inverse depths between which samples lay, 1 / metres.
        pivot: the middle one.
    """

    slope: float
    level: float
    covariance: Array
    near: float
    far: float
    pivot: float

    @property
    def scale(self) -> float:
        """1 / metres for each unit of the network."""
        return 1.0 / self.slope

    @property
    def shift(self) -> float:
        """1 / metres where the network says 0."""
        return -self.level / self.slope

    def inverse_m(self, network: float) -> float:
        """1 / metres."""
        return (network - self.level) / self.slope

    def network(self, inverse_m: float) -> float:
        """The network's answer at an inverse depth."""
        return self.slope * inverse_m + self.level

    def relative_sigma(self, inverse_m: float) -> float:
        """Relative standard deviation of depth there."""
        row = np.array([inverse_m, 1.0]) / (self.slope * inverse_m)
        return math.sqrt(max(float(row @ self.covariance @ row), 0.0))

    def relative(self) -> Array:
        """(2, 2) covariance of scale and shift when depth at the pivot is taken as exact."""
        by_slope = np.array([[-1.0, 0.0], [self.level, -self.slope]]) / self.slope**2
        covariance = by_slope @ self.covariance @ by_slope.T
        theta = np.array([self.scale, self.shift])
        keep = np.eye(2) - np.outer(theta, [self.network(self.pivot), 1.0]) / self.pivot
        return np.asarray(keep @ covariance @ keep.T)


def fit_affine(samples: AffineSamples, before: AffineShape | None, passed_s: float) -> AffineShape | None:
    """Slope and level that most samples agree on, held by the fit of the picture before.

    Random sample consensus (Fischler and Bolles, 1981) over pairs, then Tukey's biweight. It is the network
    that errs most, so its answer is regressed on inverse depth and not the other way round: before a flat
    wall the other way ends at "everything is as far as the wall" (errors in variables; Fuller, "Measurement
    Error Models", section 1.1). The trials are the same for the same samples.

    Args:
        samples: of one picture.
        before: the fit of the picture before.
        passed_s: time since it.

    Returns:
        `before` where samples are few, agree on nothing, or lie at one depth and nothing was fitted yet.
    """
    known = np.isfinite(samples.network) & np.isfinite(samples.inverse_m) & (samples.inverse_m > 0)
    a, q = samples.network[known], samples.inverse_m[known]
    weight = samples.worth[known] / (samples.sigma[known] ** 2 + _NETWORK_SCATTER**2)
    if len(a) < _LEAST_SAMPLES:
        return before
    theta = _consensus(a, q, weight, before)
    if theta is None:
        return before
    prior, expected = _prior(before, passed_s)
    information, robust = prior, weight
    for _ in range(_ITERATIONS):
        rows = np.stack([q, np.ones_like(q)], axis=1) / (theta[0] * q)[:, None]
        wanted = a / (theta[0] * q)
        distance = np.abs(wanted - rows @ theta)
        inside = distance < 2 * _GATE
        if not inside.any():
            return before
        scatter = max(1.4826 * float(np.median(distance[inside])), _NARROWEST)
        share = np.minimum(distance / (_TUKEY * scatter), 1.0)
        # The weights count errors of the usual scatter: a larger one makes the samples worth less.
        robust = weight * (1 - share**2) ** 2 * min(1.0, (_NETWORK_SCATTER / scatter) ** 2)
        information = prior + (rows * robust[:, None]).T @ rows
        if np.linalg.cond(information) > 1e14:
            return before
        last, theta = theta, np.linalg.solve(information, prior @ expected + rows.T @ (robust * wanted))
        covariance = np.linalg.inv(information)
        if theta[0] < _LEAST_SLOPE_SIGMAS * math.sqrt(covariance[0, 0]):
            return before
        if np.abs(rows @ (theta - last)).max() < 1e-3:
            break
    support = robust > 0.1 * weight
    if np.sum(weight[support]) < _LEAST_SUPPORT * np.sum(weight):
        return before
    far, pivot, near = (float(each) for each in np.quantile(q[support], [0.05, 0.5, 0.95]))
    shape = AffineShape(float(theta[0]), float(theta[1]), covariance, near, far, pivot)
    if max(shape.relative_sigma(near), shape.relative_sigma(far)) > _LARGEST_SIGMA:
        return before
    return shape


def _prior(before: AffineShape | None, passed_s: float) -> tuple[Array, Array]:
    """Information (2, 2) and expected slope and level."""
    if before is None or before.near - before.far < 1e-6:
        return np.zeros((2, 2)), np.zeros(2)
    ends = np.array([[before.near, 1.0], [before.far, 1.0]])
    drift = (before.slope * ends[:, 0]) ** 2 * (_WANDER_PER_SQRT_S**2 * max(passed_s, 1e-3))
    back = np.linalg.inv(ends)
    covariance = before.covariance + back @ np.diag(drift) @ back.T
    return np.asarray(np.linalg.inv(covariance)), np.array([before.slope, before.level])


def _consensus(a: Array, q: Array, weight: Array, before: AffineShape | None) -> Array | None:
    """Slope and level of the best pair of samples, or of the picture before."""
    rng = np.random.default_rng(0)
    chance = np.cumsum(weight) / weight.sum()
    pair = np.minimum(np.searchsorted(chance, rng.random((_TRIALS, 2))), len(a) - 1)
    first, second = pair.T
    # Pairs at nearly one depth tell no slope, only the network's scatter.
    apart = np.abs(np.log(q[first] / q[second])) > _GATE
    first, second = first[apart], second[apart]
    slope = (a[first] - a[second]) / (q[first] - q[second])
    trials = np.stack([slope, a[first] - slope * q[first]], axis=1)[slope > 0]
    if before is not None:
        trials = np.concatenate([trials, [[before.slope, before.level]]])
    if not len(trials):
        return None
    off = np.abs((a - trials[:, :1] * q - trials[:, 1:]) / (trials[:, :1] * q))
    score = np.maximum(1.0 - (off / _GATE) ** 2, 0.0) @ weight
    return np.asarray(trials[int(np.argmax(score))])
