"""What really stands ahead of the demo's vehicle, from the geometry of the rendered world."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np

AHEAD_DEG = 20.0
"""Half the fan in which both the scan and the truth look for what the vehicle stopped for."""

_BEARING_STEP_DEG = 1.0
_HEIGHT_STEP_M = 0.25
_GROUND_CLEARANCE_M = 0.3
"""Rays lower than this over the ground would report kerbs and the ground itself."""


class RayWorld(Protocol):
    """The part of a rendered scene that the truth needs."""

    def ground_height_m(self, north_m: float, east_m: float) -> Any:
        """Height of the bare ground in metres, up positive."""

    def ray_distance_m(self, origin_ned_m: Any, direction_ned: Any) -> Any:
        """(N,) distance in metres along each ray to the first surface, +inf where it is free."""


def true_distance_ahead_m(
    world: RayWorld,
    position_ned_m: Sequence[float],
    yaw_rad: float,
    below_m: float,
    above_m: float,
) -> float | None:
    """Smallest horizontal distance to any surface ahead within the scan's height band.

    Args:
        world: the rendered scene.
        position_ned_m: the vehicle, metres.
        yaw_rad: its heading.
        below_m, above_m: the height band about the vehicle, metres.

    Returns:
        Metres, or None where nothing stands within `AHEAD_DEG` of the nose.
    """
    north_m, east_m, down_m = (float(value) for value in position_ned_m)
    floor_m = -float(world.ground_height_m(north_m, east_m)) - _GROUND_CLEARANCE_M
    lowest_m = min(down_m + below_m, floor_m)
    downs = np.arange(down_m - above_m, max(lowest_m, down_m - above_m) + 1e-6, _HEIGHT_STEP_M)
    bearings = yaw_rad + np.radians(np.arange(-AHEAD_DEG, AHEAD_DEG + 1e-6, _BEARING_STEP_DEG))
    down_grid, bearing_grid = (grid.ravel() for grid in np.meshgrid(downs, bearings))
    origins = np.stack(
        [np.full_like(down_grid, north_m), np.full_like(down_grid, east_m), down_grid], axis=-1
    )
    directions = np.stack([np.cos(bearing_grid), np.sin(bearing_grid), np.zeros_like(bearing_grid)], axis=-1)
    nearest = float(np.min(world.ray_distance_m(origins, directions)))
    return nearest if np.isfinite(nearest) else None
