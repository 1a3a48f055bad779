"""Resets of the autopilot's heading: its estimate turns at once, the vehicle does not.

ArduPilot resets yaw when it aligns it before and in flight and when it changes the compass or the lane of its
estimator, PX4 when it changes its source of heading. ATTITUDE jumps then, the body rates beside it do not.
Recorded: an ArduCopter that aligns it in flight, by 2.4 degrees, and at rest, by 12.8. Between all other
messages of five logs (50 Hz, up to 45 degrees a second) rates explain the turn to 0.25 degrees.
"""

from __future__ import annotations

import math

from service.autopilot.quaternion import Quaternion, heading_between, turned

_JUMP_RAD = math.radians(1.0)
_RATE_ERROR = 0.25
"""Of the turn: rates of two messages are not those in between."""

_UNSEEN_RPS = math.radians(30.0)
"""What a vehicle may turn faster between two messages than at both."""

_LONGEST_S = 0.5
"""Over a longer gap rates say nothing, and nothing that was seen before is remembered."""

Vector = tuple[float, float, float]


def heading_reset(
    before: Quaternion, before_rps: Vector, after: Quaternion, after_rps: Vector, seconds: float
) -> float:
    """By how much the heading was reset between two attitude messages, radians clockwise; 0 where it was not.

    Args:
        before, after: body to NED.
        before_rps, after_rps: body rates, radians a second.
        seconds: between them, above 0.
    """
    # No gyroscope reads exactly nothing on three axes: such rates were not measured.
    if seconds > _LONGEST_S or not any(before_rps) or not any(after_rps):
        return 0.0
    roll, pitch, yaw = (0.5 * (first + last) for first, last in zip(before_rps, after_rps, strict=True))
    jump = heading_between(turned(before, (roll, pitch, yaw), seconds), after)
    explained = math.sqrt(roll * roll + pitch * pitch + yaw * yaw) * seconds
    return jump if abs(jump) > _JUMP_RAD + _RATE_ERROR * explained + _UNSEEN_RPS * seconds else 0.0
