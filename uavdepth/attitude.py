"""The vehicle's attitude at one moment."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavdepth.rotation import rotation_zyx


@dataclass(frozen=True)
class Attitude:
    """Euler angles of MAVLink's ATTITUDE: body FRD against NED, in radians, yaw clockwise from north."""

    roll_rad: float
    pitch_rad: float
    yaw_rad: float

    @property
    def ned_from_body(self) -> NDArray[np.float64]:
        """(3, 3) rotation from body FRD into north, east, down."""
        return rotation_zyx(self.roll_rad, self.pitch_rad, self.yaw_rad)

    @property
    def level_from_body(self) -> NDArray[np.float64]:
        """(3, 3) rotation from body FRD into the level frame: x horizontally along the nose, z down."""
        return rotation_zyx(self.roll_rad, self.pitch_rad, 0.0)
