"""Whether the autopilot's positions tell a way, or were reset in between."""

from __future__ import annotations

import math

from service.telemetry import Telemetry

_LARGEST_JUMP_M = 0.5
"""Positions that part further from the way that the velocity tells were reset in between."""


def has_jumped(first: Telemetry, second: Telemetry) -> bool:
    """Whether the positions jumped between two moments, or are those of another start of the autopilot.

    What is not known is no jump.
    """
    if first.epoch != second.epoch:
        return True
    before, after = first.position_ned_m, second.position_ned_m
    start_mps, end_mps = first.velocity_ned_mps, second.velocity_ned_mps
    if before is None or after is None or start_mps is None or end_mps is None:
        return False
    half_s = 0.5e-9 * (second.at_ns - first.at_ns)
    flown = [half_s * (start + end) for start, end in zip(start_mps, end_mps, strict=True)]
    north_m, east_m = (after[axis] - before[axis] - flown[axis] for axis in (0, 1))
    return not math.hypot(north_m, east_m) <= _LARGEST_JUMP_M
