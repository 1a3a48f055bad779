"""ArduPilot's simple avoidance: a velocity that cannot be stopped before the margin is not flown.

Acts in LOITER and in GUIDED velocity only. Not modelled: ALT_HOLD's leaning away, fences and beacons, the
vertical direction, the exact polygon between the faces (each face limits the component of the velocity that
points into it).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from service.fake_autopilot.proximity_ardupilot import FACE_COUNT, FACE_WIDTH_DEG, face_of

BRAKING_MPS2 = 1.0
"""Deceleration that the speed limit is planned with: 3.3 m/s may be flown 8 m from an obstacle, 5.0 at 15 m
and 5.9 at 20 m with a margin of 2 m (measured)."""

BACK_AWAY_GAIN_PER_S = 2.0
BACK_AWAY_BAND_M = 0.1
"""Inside margin + band the vehicle backs away at gain x depth: fitted to the SA rows of the recorded
approach (0.25 m/s at the margin, 0.4 m/s 0.1 m and 0.75 m/s 0.3 m inside it)."""


def safe_speed_mps(room_m: float) -> float:
    """Speed that can be stopped within `room_m`: braking at 1 m/s^2, and 1 m/s per metre over the last
    metre."""
    if room_m <= 0.0:
        return 0.0
    if room_m <= BRAKING_MPS2:
        return room_m
    return math.sqrt(2.0 * BRAKING_MPS2 * (room_m - BRAKING_MPS2 / 2.0))


def limit_velocity(
    forward_mps: float,
    right_mps: float,
    faces_m: Sequence[float | None],
    margin_m: float,
    slide: bool = False,
    back_away_mps: float = 0.75,
) -> tuple[float, float]:
    """Velocity in the heading frame that avoidance lets pass.

    Args:
        forward_mps, right_mps: velocity wanted.
        faces_m: eight filtered distances, None where nothing is known: such a face is open.
        margin_m: AVOID_MARGIN.
        slide: AVOID_BEHAVE 0; otherwise (1) the whole velocity is scaled down.
        back_away_mps: AVOID_BACKUP_SPD, the fastest retreat out of the margin.
    """
    scale = 1.0
    for face in range(FACE_COUNT):
        distance_m = faces_m[face]
        if distance_m is None:
            continue
        ahead, aside = _direction(face, forward_mps, right_mps)
        closing = forward_mps * ahead + right_mps * aside
        allowed = safe_speed_mps(distance_m - margin_m - BACK_AWAY_BAND_M)
        if closing <= allowed:
            continue
        if slide:
            forward_mps -= (closing - allowed) * ahead
            right_mps -= (closing - allowed) * aside
        else:
            scale = min(scale, allowed / closing)
    return _back_away(forward_mps * scale, right_mps * scale, faces_m, margin_m, back_away_mps)


def _back_away(
    forward_mps: float, right_mps: float, faces_m: Sequence[float | None], margin_m: float, fastest_mps: float
) -> tuple[float, float]:
    for face in range(FACE_COUNT):
        distance_m = faces_m[face]
        if distance_m is None or distance_m >= margin_m + BACK_AWAY_BAND_M:
            continue
        retreat = min(BACK_AWAY_GAIN_PER_S * (margin_m + BACK_AWAY_BAND_M - distance_m), fastest_mps)
        ahead, aside = _centre(face)
        closing = forward_mps * ahead + right_mps * aside
        if closing > -retreat:
            forward_mps -= (closing + retreat) * ahead
            right_mps -= (closing + retreat) * aside
    return forward_mps, right_mps


def _direction(face: int, forward_mps: float, right_mps: float) -> tuple[float, float]:
    """Where in a face the obstacle is taken to stand: in the direction of flight, or else at the face's
    centre."""
    speed = math.hypot(forward_mps, right_mps)
    if speed > 0.0 and face_of(math.degrees(math.atan2(right_mps, forward_mps))) == face:
        return forward_mps / speed, right_mps / speed
    return _centre(face)


def _centre(face: int) -> tuple[float, float]:
    bearing = math.radians(face * FACE_WIDTH_DEG)
    return math.cos(bearing), math.sin(bearing)
