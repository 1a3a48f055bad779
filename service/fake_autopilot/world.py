"""What the simulated vehicle stands on, flies over and can run into."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol


class World(Protocol):
    """The part of a rendered scene that the flight needs (`uavdepth.scenes.Scene` has it)."""

    def ground_height_m(self, north_m: float, east_m: float) -> Any:
        """Height of the bare ground in metres, up positive."""

    def ray_distance_m(self, origin_ned_m: Any, direction_ned: Any) -> Any:
        """(N,) distance in metres along a ray to the first surface, +inf where it is free."""

    def clearance_m(self, position_ned_m: Sequence[float]) -> float:
        """Distance in metres to the nearest surface of anything, the ground too."""


class FlatGround:
    """Nothing but flat ground at down = 0."""

    def ground_height_m(self, north_m: float, east_m: float) -> float:
        return 0.0

    def ray_distance_m(self, origin_ned_m: Any, direction_ned: Any) -> list[float]:
        down_m, slope = float(origin_ned_m[2]), float(direction_ned[2])
        return [max(-down_m, 0.0) / slope if slope > 0.0 else float("inf")]

    def clearance_m(self, position_ned_m: Sequence[float]) -> float:
        return max(-float(position_ned_m[2]), 0.0)
