"""Which hints a training picture comes with: any subset, with the errors that a vehicle's have."""

from __future__ import annotations

import math
from dataclasses import astuple, dataclass

import numpy as np
from numpy.typing import NDArray

from training.data.point_hints import sample_point_hints
from training.data.views import View
from training.errors import TrainingSettingsError
from training.normalization import FOCAL_REFERENCE_PX
from uavdepth.attitude import Attitude
from uavdepth.model.hint_planes import ground_plane, point_pixels
from uavdepth.model.hints import GroundHint, Hints

POINT_COUNTS = (5, 300)
"""Fewest and most points of a picture, drawn log-uniformly."""

HEIGHT_SIGMA = 0.03
HEIGHT_SIGMA_M = 0.1
TILT_SIGMA_RAD = math.radians(0.7)
"""Errors of a rangefinder's or estimator's height, and of roll and pitch at the moment of the picture."""

LOWEST_HEIGHT_M = 0.3
"""Lower, rangefinders give no height."""


@dataclass(frozen=True)
class HintShares:
    """Shares of pictures that come with each subset of hints; together 1."""

    none: float = 0.2
    ground: float = 0.25
    points: float = 0.15
    both: float = 0.4

    def __post_init__(self) -> None:
        shares = astuple(self)
        if any(not 0.0 <= share <= 1.0 for share in shares) or abs(sum(shares) - 1.0) > 1e-6:
            raise TrainingSettingsError(f"shares of hints are {shares}: 0 to 1 each, together 1 is needed")

    def draw(self, rng: np.random.Generator) -> tuple[bool, bool]:
        """Whether the next picture has the ground's hint, and whether it has points."""
        kinds = ((False, False), (True, False), (False, True), (True, True))
        shares = np.array(astuple(self))
        return kinds[int(rng.choice(len(kinds), p=shares / shares.sum()))]


def sample_hints(
    rng: np.random.Generator,
    view: View,
    height_m: float | None,
    image_bgr: NDArray[np.uint8],
    depth_m: NDArray[np.float32],
    shares: HintShares,
) -> Hints:
    """Random hints of a picture.

    Args:
        rng: random numbers.
        view: of the picture.
        height_m: above whatever is straight below the vehicle, or None; then there is no ground hint.
        image_bgr, depth_m: (H, W, 3) picture and (H, W) exact z-depth, inf for sky.
        shares: of the subsets.
    """
    with_ground, with_points = shares.draw(rng)
    ground = sample_ground_hint(rng, view, height_m) if with_ground and height_m is not None else None
    if not with_points:
        return Hints(ground)
    count = round(math.exp(rng.uniform(*np.log(POINT_COUNTS))))
    return Hints(ground, sample_point_hints(rng, image_bgr, depth_m, view.camera, count))


def sample_ground_hint(rng: np.random.Generator, view: View, height_m: float) -> GroundHint | None:
    """The ground as a vehicle knows it, or None if it is too low for its rangefinder."""
    measured_m = height_m * (1.0 + rng.normal(0.0, HEIGHT_SIGMA)) + rng.normal(0.0, HEIGHT_SIGMA_M)
    roll, pitch = rng.normal(0.0, TILT_SIGMA_RAD, 2)
    if measured_m < LOWEST_HEIGHT_M:
        return None
    attitude = view.attitude
    return GroundHint(
        view.mount,
        Attitude(attitude.roll_rad + roll, attitude.pitch_rad + pitch, attitude.yaw_rad),
        measured_m,
    )


def hint_maps(
    hints: Hints, view: View, width: int, height: int
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """(1, height, width) ground and (2, height, width) points as the network takes them."""
    ground = np.zeros((1, height, width), np.float32)
    if hints.ground is not None:
        ground[0] = ground_plane(hints.ground, view.camera, width, height, FOCAL_REFERENCE_PX)
    if hints.points is None:
        return ground, np.zeros((2, height, width), np.float32)
    return ground, point_pixels(hints.points, view.camera, width, height, FOCAL_REFERENCE_PX).planes
