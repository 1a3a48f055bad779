"""What a point measured by motion must be to be believed."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class MotionPointSettings:
    """What a point must be to be believed.

    Args:
        pixel_sigma: standard deviation of a tracked corner, pixels (of a picture at most 640 wide).
        drift_sigma: what is added to it for each 10 pictures that a corner was followed.
        least_views: pictures besides the newest that must have seen a point.
        longest_window_s: oldest picture that is used.
        least_parallax_rad: smallest angle between two rays to a point.
        largest_sigma: largest relative standard deviation of depth.
        largest_carried_sigma: the same for one that was measured earlier.
        largest_residual: largest re-projection error (root mean square), in standard deviations.
        nearest_m, farthest_m: depths that are believed.
        model_sigma: relative error of depth that noise does not explain: calibration, mount, time stamps.
        carry_s: how long a point is carried along that is neither measured any more nor, in a hover, seen
            where it should be.
        edges: near edges are measured besides.
    """

    pixel_sigma: float = 0.3
    drift_sigma: float = 0.2
    least_views: int = 2
    longest_window_s: float = 1.5
    least_parallax_rad: float = math.radians(0.6)
    largest_sigma: float = 0.2
    largest_carried_sigma: float = 0.35
    largest_residual: float = 1.8
    nearest_m: float = 0.5
    farthest_m: float = 80.0
    model_sigma: float = 0.02
    carry_s: float = 2.0
    edges: bool = True
