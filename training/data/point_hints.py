"""Points of known depth as a vehicle would measure them: tracked corners, triangulated over a short baseline.

Their errors are those of triangulation. Depth from parallax has a relative error that grows with depth
(Hartley and Zisserman, section 12.6), the tracker's report of it is itself only an estimate, all points of
a picture share the error of the baseline, and some are plainly wrong.
"""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from uavdepth.camera import CameraModel
from uavdepth.model.hints import PointHints

FARTHEST_POINT_M = 80.0
"""Beyond it a few decimetres of baseline give no parallax."""

LARGEST_SIGMA = 0.3
"""Points with a larger relative error than this are not triangulated at all."""

_SMALLEST_SIGMA = 0.02
_SIGMA_PER_METRE = (0.001, 0.008)
"""Relative sigma of depth for each metre of depth, drawn once a picture: a fast or a slow flight."""

_REPORT_SPREAD = 0.3
_BASELINE_SIGMA = 0.01
_LARGEST_OUTLIER_SHARE = 0.1
_OUTLIER_LOGS = (0.3, 1.0)
_CORNER_QUALITY = (0.003, 0.08)
_CORNER_DISTANCE_SHARE = (0.006, 0.03)
"""Smallest distance between corners, as a share of the picture's width."""

_LARGEST_RANDOM_SHARE = 0.3
_CLUSTER_SHARE = 0.3
_CLUSTER_RADII = (0.1, 0.35)
_SLIPPED_SHARE = 0.3
_CANDIDATES = 2


def sample_point_hints(
    rng: np.random.Generator,
    image_bgr: NDArray[np.uint8],
    depth_m: NDArray[np.float32],
    camera: CameraModel,
    count: int,
) -> PointHints:
    """Noisy depth of corners of a picture, and of some random pixels.

    A picture of poor texture gives fewer points than asked for, and so does one of sky: points on the sky,
    beyond `FARTHEST_POINT_M` or less certain than `LARGEST_SIGMA` are left out.

    Args:
        rng: random numbers.
        image_bgr: (H, W, 3) uint8 picture.
        depth_m: (H, W) float32 exact z-depth, inf for sky.
        camera: of the picture.
        count: how many points to look for.

    Returns:
        Points in the camera's pixels, at most `count`.
    """
    pixels = _pixels(rng, image_bgr, camera, count)
    # A corner on an outline belongs to the thing in front or to what is behind it: trackers slip.
    slip = rng.integers(-1, 2, pixels.shape) * (rng.random((len(pixels), 1)) < _SLIPPED_SHARE)
    column, row = np.clip(np.rint(pixels).astype(np.intp) + slip, 0, (camera.width - 1, camera.height - 1)).T
    truth = depth_m[row, column]
    per_metre = math.exp(rng.uniform(*np.log(_SIGMA_PER_METRE)))
    sigma = np.hypot(_SMALLEST_SIGMA, per_metre * truth)
    measured = np.isfinite(truth) & (truth > 0) & (truth < FARTHEST_POINT_M) & (sigma < LARGEST_SIGMA)
    pixels, truth, sigma = pixels[measured][:count], truth[measured][:count], sigma[measured][:count]
    return PointHints(
        pixels.astype(np.float32),
        _triangulated(rng, truth, sigma),
        (sigma * np.exp(rng.normal(0.0, _REPORT_SPREAD, len(sigma)))).astype(np.float32),
    )


def _triangulated(
    rng: np.random.Generator, truth: NDArray[np.float32], sigma: NDArray[np.float64]
) -> NDArray[np.float32]:
    """Depth with the error of its parallax, of the baseline, and outliers."""
    # The parallax, inverse depth, has the symmetric error.
    parallax = np.clip(1.0 + sigma * rng.standard_normal(len(truth)), 0.4, 2.5)
    baseline = math.exp(rng.normal(0.0, _BASELINE_SIGMA))
    outlier = rng.random(len(truth)) < rng.uniform(0.0, _LARGEST_OUTLIER_SHARE)
    slipped = np.exp(rng.uniform(*_OUTLIER_LOGS, len(truth)) * rng.choice((-1.0, 1.0), len(truth)))
    return np.asarray(truth * baseline / parallax * np.where(outlier, slipped, 1.0), np.float32)


def _pixels(
    rng: np.random.Generator, image_bgr: NDArray[np.uint8], camera: CameraModel, count: int
) -> NDArray[np.float64]:
    """(N, 2) x, y of corners and random pixels in random order, more than `count` of them if there are."""
    wanted = _CANDIDATES * count
    random_count = int(wanted * rng.uniform(0.0, _LARGEST_RANDOM_SHARE))
    corners = _corners(rng, image_bgr, wanted - random_count)
    anywhere = rng.uniform((0.0, 0.0), (camera.width - 1, camera.height - 1), (random_count, 2))
    pixels = rng.permutation(np.concatenate([corners, anywhere]))
    if rng.random() < _CLUSTER_SHARE and len(pixels):
        # Many trackers lose what is far from the direction of flight, or see texture on one side only.
        centre = pixels[int(rng.integers(len(pixels)))]
        radius = rng.uniform(*_CLUSTER_RADII) * camera.width
        distance = np.linalg.norm(pixels - centre, axis=1)
        pixels = pixels[rng.random(len(pixels)) < np.exp(-0.5 * (distance / radius) ** 2)]
    return pixels


def _corners(rng: np.random.Generator, image_bgr: NDArray[np.uint8], count: int) -> NDArray[np.float64]:
    """(N, 2) x, y of the best corners (Shi and Tomasi 1994), none of much lower quality than the best."""
    if count < 1:
        return np.empty((0, 2))
    gray = cv2.cvtColor(image_bgr, cv2.COLOR_BGR2GRAY)
    quality = math.exp(rng.uniform(*np.log(_CORNER_QUALITY)))
    distance = rng.uniform(*_CORNER_DISTANCE_SHARE) * image_bgr.shape[1]
    found = cv2.goodFeaturesToTrack(gray, count, quality, distance)
    return np.empty((0, 2)) if found is None else np.asarray(found, np.float64).reshape(-1, 2)
