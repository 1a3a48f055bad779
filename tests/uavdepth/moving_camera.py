"""A camera on a vehicle that flies past points or textured walls, solved exactly."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
from numpy.typing import NDArray

from uavdepth import Attitude, CameraModel, CameraMount
from uavdepth.motion.vehicle_motion import MotionNoise, VehicleMotion

Place = Callable[[float], tuple[tuple[float, float, float], tuple[float, float, float]]]
"""Position and velocity (NED) at a time in seconds."""

LEVEL = Attitude(0.0, 0.0, 0.0)


def straight(velocity: tuple[float, float, float]) -> Place:
    """Flight at one velocity from the origin."""
    north, east, down = velocity
    return lambda t_s: ((north * t_s, east * t_s, down * t_s), velocity)


def stops_after(velocity: tuple[float, float, float], stop_s: float) -> Place:
    """Flight at one velocity, half a second of braking, then hover."""

    def place(t_s: float) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
        braking_s = min(max(t_s - stop_s, 0.0), 0.5)
        travelled = min(t_s, stop_s) + braking_s - braking_s**2
        north, east, down = (part * travelled for part in velocity)
        v_north, v_east, v_down = (part * (1 - 2 * braking_s) for part in velocity)
        return (north, east, down), (v_north, v_east, v_down)

    return place


def told(
    place: Place,
    until_s: float,
    yaw_rad: Callable[[float], float] = lambda t_s: 0.0,
    noise: MotionNoise | None = None,
) -> VehicleMotion:
    """What an exact autopilot has said: attitude and position at 20 Hz."""
    motion = VehicleMotion(noise)
    for step in range(round(until_s * 20) + 1):
        t_s = step / 20
        motion.add_attitude(round(t_s * 1e9), Attitude(0.0, 0.0, yaw_rad(t_s)))
        motion.add_position(round(t_s * 1e9), *place(t_s))
    return motion


def wall_picture(
    camera: CameraModel, position_ned_m: tuple[float, float, float], distance_m: float, yaw_rad: float = 0.0
) -> NDArray[np.uint8]:
    """(H, W, 3) of a painted wall that stands across the north axis, `distance_m` north of the origin."""
    paint = _paint()
    turn = Attitude(0.0, 0.0, yaw_rad).ned_from_body @ CameraMount().body_from_camera
    rays = camera.normalized_rays.astype(np.float64) @ turn.T
    north, east, down = position_ned_m
    reach = (distance_m - north) / np.maximum(rays[..., 0], 0.05)
    column = (east + reach * rays[..., 1]) * _PAINT_PX_PER_M + paint.shape[1] / 2
    row = (down + reach * rays[..., 2]) * _PAINT_PX_PER_M + paint.shape[0] / 2
    grey = cv2.remap(
        paint, column.astype(np.float32), row.astype(np.float32), cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP
    )
    return np.asarray(cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR), dtype=np.uint8)


_PAINT_PX_PER_M = 12.0


def _paint() -> NDArray[np.uint8]:
    rng = np.random.default_rng(7)
    coarse = cv2.GaussianBlur(rng.uniform(0, 255, (1024, 1024)).astype(np.float32), (0, 0), 2.0)
    low, high = float(coarse.min()), float(coarse.max())
    return ((coarse - low) / (high - low) * 255).astype(np.uint8)
