"""The fields of one received OBSTACLE_DISTANCE that an autopilot looks at."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

UNKNOWN_WORD = 65535
"""UINT16_MAX: nothing known in this direction (MAVLink common, message 330)."""


@dataclass(frozen=True)
class ObstacleWords:
    """OBSTACLE_DISTANCE as words, without the fields that both autopilots were measured to ignore.

    Args:
        distances_cm: up to 72 words: centimetres, above the maximum for clear, 65535 for unknown.
        increment_deg: the integer field `increment`, degrees.
        increment_f_deg: the float field `increment_f`, degrees; 0 where it is not used.
        offset_deg: bearing of element 0 in degrees, clockwise.
        min_distance_cm, max_distance_cm: range of the sensor.
        frame: MAV_FRAME.
    """

    distances_cm: Sequence[int]
    increment_deg: int = 5
    increment_f_deg: float = 5.0
    offset_deg: float = -155.0
    min_distance_cm: int = 20
    max_distance_cm: int = 2000
    frame: int = 12

    @classmethod
    def from_message(cls, message: Any) -> ObstacleWords:
        """Take the fields out of a pymavlink OBSTACLE_DISTANCE."""
        return cls(
            distances_cm=tuple(message.distances),
            increment_deg=int(message.increment),
            increment_f_deg=float(message.increment_f),
            offset_deg=float(message.angle_offset),
            min_distance_cm=int(message.min_distance),
            max_distance_cm=int(message.max_distance),
            frame=int(message.frame),
        )

    @property
    def is_finite(self) -> bool:
        """Whether both float fields are finite; ArduPilot's simulator aborts where they are not."""
        return math.isfinite(self.increment_f_deg) and math.isfinite(self.offset_deg)
