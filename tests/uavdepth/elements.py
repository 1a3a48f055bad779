"""Short words for what the tests of the scanner say over and over."""

from __future__ import annotations

import math

import numpy as np

from uavdepth import Attitude, ObstacleScan, SectorState


def element(bearing_deg: float) -> int:
    """Index of the element at a bearing."""
    return round((bearing_deg + 155) / 5) % 72


def attitude_deg(roll: float = 0.0, pitch: float = 0.0, yaw: float = 0.0) -> Attitude:
    return Attitude(math.radians(roll), math.radians(pitch), math.radians(yaw))


def obstacles(scan: ObstacleScan) -> list[int]:
    """Indices of the elements that hold an obstacle."""
    return np.flatnonzero(scan.state == SectorState.OBSTACLE).tolist()
