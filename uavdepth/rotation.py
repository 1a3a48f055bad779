"""Rotation matrices of the aerospace Euler sequence, written once for every frame of the project."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray


def rotation_zyx(roll_rad: float, pitch_rad: float, yaw_rad: float) -> NDArray[np.float64]:
    """(3, 3) matrix Rz(yaw) Ry(pitch) Rx(roll): takes vectors of the rotated frame into the parent frame.

    Roll, pitch and yaw are about the forward, right and down axes, as in MAVLink's ATTITUDE.
    """
    sr, cr = math.sin(roll_rad), math.cos(roll_rad)
    sp, cp = math.sin(pitch_rad), math.cos(pitch_rad)
    sy, cy = math.sin(yaw_rad), math.cos(yaw_rad)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )
