"""Rotations between two attitude messages."""

from __future__ import annotations

import math

from uavdepth.attitude import Attitude

Quaternion = tuple[float, float, float, float]
"""(w, x, y, z), unit length: takes body FRD into NED."""


def from_attitude(attitude: Attitude) -> Quaternion:
    """Quaternion of the Euler angles (yaw, pitch, roll sequence)."""
    sr, cr = math.sin(attitude.roll_rad / 2), math.cos(attitude.roll_rad / 2)
    sp, cp = math.sin(attitude.pitch_rad / 2), math.cos(attitude.pitch_rad / 2)
    sy, cy = math.sin(attitude.yaw_rad / 2), math.cos(attitude.yaw_rad / 2)
    return (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )


def to_attitude(q: Quaternion) -> Attitude:
    """Euler angles of the quaternion: roll and yaw in -pi to pi, pitch in -pi/2 to pi/2, radians."""
    w, x, y, z = q
    return Attitude(
        math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)),
        math.asin(min(1.0, max(-1.0, 2 * (w * y - z * x)))),
        math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)),
    )


def slerp(a: Quaternion, b: Quaternion, fraction: float) -> Quaternion:
    """The rotation `fraction` of the way from `a` (0) to `b` (1), along the shorter arc."""
    dot = sum(p * q for p, q in zip(a, b, strict=True))
    sign = -1.0 if dot < 0 else 1.0
    angle = math.acos(min(1.0, abs(dot)))
    if angle < 1e-4:
        wa, wb = 1.0 - fraction, sign * fraction
    else:
        wa = math.sin((1.0 - fraction) * angle) / math.sin(angle)
        wb = sign * math.sin(fraction * angle) / math.sin(angle)
    return _unit((wa * a[0] + wb * b[0], wa * a[1] + wb * b[1], wa * a[2] + wb * b[2], wa * a[3] + wb * b[3]))


def turned(q: Quaternion, body_rates_rps: tuple[float, float, float], seconds: float) -> Quaternion:
    """`q` after turning with constant rates about the body axes, radians a second, for `seconds`."""
    p, r, y = body_rates_rps
    rate = math.sqrt(p * p + r * r + y * y)
    half = rate * seconds / 2
    k = math.sin(half) / rate if rate > 1e-9 else seconds / 2
    w, x, yy, z = q
    tw, tx, ty, tz = math.cos(half), p * k, r * k, y * k
    return _unit(
        (
            w * tw - x * tx - yy * ty - z * tz,
            w * tx + x * tw + yy * tz - z * ty,
            w * ty - x * tz + yy * tw + z * tx,
            w * tz + x * ty - yy * tx + z * tw,
        )
    )


def heading_between(a: Quaternion, b: Quaternion) -> float:
    """The part about the vertical of the rotation from `a` to `b`, radians clockwise seen from above."""
    aw, ax, ay, az = a
    bw, bx, by, bz = b
    w = bw * aw + bx * ax + by * ay + bz * az
    z = bz * aw - bw * az + by * ax - bx * ay
    return math.remainder(2 * math.atan2(z, w), math.tau)


def headed(q: Quaternion, angle_rad: float) -> Quaternion:
    """`q` turned about the vertical, clockwise seen from above."""
    c, s = math.cos(angle_rad / 2), math.sin(angle_rad / 2)
    w, x, y, z = q
    return (c * w - s * z, c * x - s * y, c * y + s * x, c * z + s * w)


def _unit(q: Quaternion) -> Quaternion:
    norm = math.sqrt(sum(value * value for value in q))
    return (q[0] / norm, q[1] / norm, q[2] / norm, q[3] / norm)
