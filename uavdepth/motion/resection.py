"""Where a camera is against points whose places are known: what the autopilot said of its motion, made right.

In a hover nothing can be measured anew, but what was measured on the way there is still in view. Where all of
it is seen as it would be after a small motion, that motion is the camera's, and the points are where they
were. Space resection by iteratively reweighted least squares, with the autopilot's motion as a prior: Hartley
and Zisserman, "Multiple View Geometry", 2nd edition, sections 7.2 and A6.8.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

LARGEST_RESIDUAL = 3.0
"""Standard deviations at which a point is not where it was any more."""

_LEAST_POINTS = 12
_LEAST_SHARE = 0.6
"""Of the points, that must agree: else the scene has moved, or the camera otherwise than was said."""

_LARGEST_CORRECTION = 3.0
"""Standard deviations of the prior; what is farther off is another motion than the one that was told."""

_ITERATIONS = 5
_KIND = 2.0
"""Points whose residual is beyond it, in standard deviations, count less and less (Geman and McClure
1985)."""


@dataclass(frozen=True, eq=False)
class Resection:
    """A small motion of all points in the camera's axes: X becomes `rotation @ X + offset_m`.

    Args:
        rotation: (3, 3).
        offset_m: (3,).
        offset_sigma_m: the largest standard deviation of the offset's components.
        agrees: (N,) bool, the points that are where they should be.
    """

    rotation: Array
    offset_m: Array
    offset_sigma_m: float
    agrees: NDArray[np.bool_]


def resect(
    points: Array, rays: Array, ray_sigma: float, offset_sigma_m: float, turn_sigma_rad: float
) -> Resection | None:
    """The motion that brings points to where they are seen; None where there is none that most agree on.

    Args:
        points: (N, 3) places in the camera's axes, by what was told of the camera's motion; z above 0.
        rays: (N, 2) normalised x, y at which they are seen.
        ray_sigma: one standard deviation of those (pixels over focal length).
        offset_sigma_m: one standard deviation of each axis of the motion that was told, metres.
        turn_sigma_rad: the same of its turn.
    """
    if len(points) < _LEAST_POINTS:
        return None
    prior = np.diag([turn_sigma_rad**-2] * 3 + [offset_sigma_m**-2] * 3)
    motion = np.zeros(6)
    for _ in range(_ITERATIONS):
        moved = points @ _rotation(motion).T + motion[3:]
        if not (moved[:, 2] > 0).all():
            return None
        error, slope = _error_and_slope(moved, rays)
        weight = 1.0 / np.square(1.0 + np.square(_size(error) / (_KIND * ray_sigma))) / ray_sigma**2
        weighted = slope * weight[:, None, None]
        information = np.einsum("nai,naj->ij", weighted, slope) + prior
        motion = motion + np.linalg.solve(
            information, np.einsum("nai,na->i", weighted, error) - prior @ motion
        )
    moved = points @ _rotation(motion).T + motion[3:]
    with np.errstate(divide="ignore", invalid="ignore"):
        residual = _size(rays - moved[:, :2] / moved[:, 2:]) / ray_sigma
        agrees = np.asarray((residual <= LARGEST_RESIDUAL) & (moved[:, 2] > 0), dtype=np.bool_)
    expected = np.repeat([turn_sigma_rad, offset_sigma_m], 3)
    # Written so that NaN fails.
    if not (np.abs(motion) <= _LARGEST_CORRECTION * expected).all() or not agrees.mean() >= _LEAST_SHARE:
        return None
    covariance = np.linalg.inv(information)
    return Resection(_rotation(motion), motion[3:], float(np.sqrt(covariance.diagonal()[3:].max())), agrees)


def _error_and_slope(points: Array, rays: Array) -> tuple[Array, Array]:
    """(N, 2) seen less expected, and (N, 2, 6) how the expected changes with a further turn and offset."""
    x, y, inverse = points[:, 0] / points[:, 2], points[:, 1] / points[:, 2], 1.0 / points[:, 2]
    zero = np.zeros_like(x)
    slope = np.stack(
        [
            np.stack([-x * y, 1.0 + x * x, -y, inverse, zero, -x * inverse], axis=1),
            np.stack([-1.0 - y * y, x * y, x, zero, inverse, -y * inverse], axis=1),
        ],
        axis=1,
    )
    return np.stack([rays[:, 0] - x, rays[:, 1] - y], axis=1), slope


def _rotation(motion: Array) -> Array:
    matrix, _ = cv2.Rodrigues(motion[:3])
    return np.asarray(matrix, dtype=np.float64)


def _size(vectors: Array) -> Array:
    return np.asarray(np.sqrt(np.square(vectors).sum(axis=1)))
