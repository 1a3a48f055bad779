"""`[motion]`: points measured by the vehicle's own motion."""

from __future__ import annotations

import math

from pydantic import Field

from service.settings.section import Section
from uavdepth.motion.vehicle_motion import MotionNoise


class MotionSettings(Section):
    """Points of the picture whose distance the vehicle's own motion tells."""

    points: bool = Field(
        default=True,
        title="Measure points",
        description="Follows corners from picture to picture and measures their distance by the way that the "
        "vehicle went; takes 6 to 9 ms of one core a picture. They give metres, together with the height or "
        "instead of it, while the vehicle moves, in a hover while they stay in view, and for 2 s without "
        "either.",
    )
    edges: bool = Field(
        default=True,
        title="Measure near edges",
        description="Measures edges within 8 m besides: posts, roofs and wires have no corners to follow. "
        "Takes 10 ms more of one core, 11 times a second at most, after the picture's distances were sent.",
    )
    attitude_sigma_deg: float = Field(
        default=0.5,
        ge=0.05,
        le=10.0,
        title="Uncertainty of the attitude, degrees",
        description="One standard deviation of ATTITUDE at the time of a picture, clock errors included.",
    )
    velocity_sigma_mps: float = Field(
        default=0.1,
        ge=0.01,
        le=5.0,
        title="Uncertainty of the velocity, m/s",
        description="One standard deviation of the EKF's velocity on each axis: 0.1 with good GPS or optical "
        "flow, more without.",
    )
    position_sigma_m: float = Field(
        default=0.1,
        ge=0.01,
        le=50.0,
        title="Uncertainty of the position, metres",
        description="One standard deviation of the EKF's position against where it was a second ago.",
    )

    @property
    def noise(self) -> MotionNoise:
        """The same as the library takes it."""
        return MotionNoise(
            math.radians(self.attitude_sigma_deg), self.velocity_sigma_mps, self.position_sigma_m
        )
