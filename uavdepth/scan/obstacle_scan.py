"""The scan: what stands around the nose, one of three states in each direction."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

SECTOR_COUNT = 72
"""Elements of OBSTACLE_DISTANCE.distances (MAVLink common, message 330)."""

SECTOR_WIDTH_DEG = 5.0
"""Width of one element. Below 5 degrees PX4 reads past the array (measured, v1.15.4 and v1.18)."""

FIRST_BEARING_DEG = -155.0
"""Bearing of element 0: a multiple of PX4's 5 degree bins, and one that starts inside ArduPilot's rear
face, so that no 45 degree face with a field of view is visited twice (measured, ArduCopter 4.8-dev)."""


class SectorState(IntEnum):
    """What is known of one direction. Whatever is not known is UNKNOWN, never CLEAR."""

    UNKNOWN = 0
    CLEAR = 1
    OBSTACLE = 2


@dataclass(frozen=True)
class ObstacleScan:
    """Distances round the vehicle in the level frame, 72 elements of 5 degrees.

    Args:
        distance_m: (72,) float32, horizontal distance in the level frame; NaN unless the state is OBSTACLE.
        state: (72,) uint8 of `SectorState`.
        bearing_deg: (72,) float32, centre of each element, clockwise from the nose seen from above,
            from -155 in steps of 5.
        min_distance_m, max_distance_m: what the scan covers; constant through a flight.
    """

    distance_m: NDArray[np.float32]
    state: NDArray[np.uint8]
    bearing_deg: NDArray[np.float32]
    min_distance_m: float
    max_distance_m: float

    @property
    def nearest_m(self) -> float | None:
        """Distance of the nearest obstacle in metres, or None where no element holds one."""
        found = self.distance_m[self.state == SectorState.OBSTACLE]
        return float(found.min()) if found.size else None


def sector_bearings_deg() -> NDArray[np.float32]:
    """(72,) float32 centres of the elements in degrees, -155 to 200 in steps of 5 (not wrapped)."""
    return (FIRST_BEARING_DEG + SECTOR_WIDTH_DEG * np.arange(SECTOR_COUNT)).astype(np.float32)
