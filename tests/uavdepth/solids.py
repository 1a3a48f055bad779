"""Exact depth of simple solids, from the equation of each: the world that geometry is tested on."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from uavdepth import Attitude, CameraModel, CameraMount

Array = NDArray[np.float64]
Solid = Callable[[Array, Array], Array]
"""Origin (3,) and directions (N, 3) in the level frame, down positive, vehicle at (0, 0, 0); gives the
(N,) multiple of each direction at which it is met, +inf where it is not."""


def ground(height_m: float) -> Solid:
    """Level ground `height_m` below the vehicle."""

    def meet(origin: Array, rays: Array) -> Array:
        with np.errstate(divide="ignore"):
            t = (height_m - origin[2]) / rays[:, 2]
        return np.where(t > 0, t, np.inf)

    return meet


def slope(height_m: float, rise_deg: float, from_m: float | None = None) -> Solid:
    """Ground `height_m` below the vehicle that rises ahead: everywhere, or from `from_m` on."""
    climb = np.tan(np.radians(rise_deg))
    foot = 0.0 if from_m is None else from_m

    def meet(origin: Array, rays: Array) -> Array:
        with np.errstate(divide="ignore", invalid="ignore"):
            flat = (height_m - origin[2]) / rays[:, 2]
            risen = (height_m - origin[2] - climb * (origin[0] - foot)) / (rays[:, 2] + climb * rays[:, 0])
            before = (from_m is not None) & (origin[0] + flat * rays[:, 0] < foot)
            beyond = (from_m is None) | (origin[0] + risen * rays[:, 0] >= foot)
        flat = np.where((flat > 0) & before, flat, np.inf)
        return np.minimum(flat, np.where((risen > 0) & beyond, risen, np.inf))

    return meet


def box(lowest: Sequence[float], highest: Sequence[float]) -> Solid:
    """Box along the level frame's axes between two corners (forward, right, down)."""

    def meet(origin: Array, rays: Array) -> Array:
        with np.errstate(divide="ignore", invalid="ignore"):
            first = (np.asarray(lowest, float) - origin) / rays
            second = (np.asarray(highest, float) - origin) / rays
        enter = np.fmin(first, second).max(axis=1)
        leave = np.fmax(first, second).min(axis=1)
        return np.where((enter <= leave) & (enter > 0), enter, np.inf)

    return meet


def wall(distance_m: float) -> Solid:
    """Endless wall across the nose."""
    return box((distance_m, -500, -500), (distance_m + 1, 500, 500))


def pole(
    bearing_deg: float, distance_m: float, radius_m: float, top_m: float = -50, foot_m: float = 50
) -> Solid:
    """Upright cylinder; `distance_m` is to its axis, top and foot are down positive."""
    bearing = np.radians(bearing_deg)
    axis = distance_m * np.array([np.cos(bearing), np.sin(bearing)])

    def meet(origin: Array, rays: Array) -> Array:
        to_axis = origin[:2] - axis
        a = np.square(rays[:, :2]).sum(axis=1)
        b = rays[:, :2] @ to_axis
        c = to_axis @ to_axis - radius_m**2
        with np.errstate(divide="ignore", invalid="ignore"):
            t = (-b - np.sqrt(b * b - a * c)) / a
            height = origin[2] + t * rays[:, 2]
            return np.where((t > 0) & (height >= top_m) & (height <= foot_m), t, np.inf)

    return meet


def wire(first: Sequence[float], second: Sequence[float], thick_m: float) -> Solid:
    """Round bar between two points (forward, right, down)."""
    start = np.asarray(first, float)
    length = float(np.linalg.norm(np.asarray(second, float) - start))
    along = (np.asarray(second, float) - start) / length

    def meet(origin: Array, rays: Array) -> Array:
        off = origin - start
        across, aside = rays - np.outer(rays @ along, along), off - (off @ along) * along
        a, b, c = np.square(across).sum(axis=1), across @ aside, aside @ aside - (thick_m / 2) ** 2
        with np.errstate(divide="ignore", invalid="ignore"):
            t = (-b - np.sqrt(b * b - a * c)) / a
            place = off @ along + t * (rays @ along)
            return np.where((t > 0) & (place > 0) & (place < length), t, np.inf)

    return meet


def turned(solid: Solid, by_deg: float) -> Solid:
    """The solid turned clockwise, seen from above, round the vehicle."""
    angle = np.radians(by_deg)
    cosine, sine = np.cos(angle), np.sin(angle)
    back = np.array([[cosine, sine, 0.0], [-sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    return lambda origin, rays: solid(back @ origin, rays @ back.T)


def depth_of(
    solids: Sequence[Solid], camera: CameraModel, mount: CameraMount, attitude: Attitude
) -> NDArray[np.float32]:
    """(H, W) float32 z-depth of the nearest solid at each pixel, +inf where there is none."""
    turn = attitude.level_from_body
    rays = camera.normalized_rays.reshape(-1, 3).astype(np.float64) @ (turn @ mount.body_from_camera).T
    origin = turn @ mount.position_body_m
    depth = np.full(len(rays), np.inf)
    for solid in solids:
        depth = np.minimum(depth, solid(origin, rays))
    return depth.reshape(camera.height, camera.width).astype(np.float32)


def smooth_noise(rng: np.random.Generator, shape: tuple[int, int], sigma: float) -> NDArray[np.float32]:
    """(H, W) factors round 1 that change slowly over the picture, as a network's errors do."""
    import cv2

    coarse = rng.normal(0.0, 1.0, (shape[0] // 16, shape[1] // 16)).astype(np.float32)
    fine = cv2.resize(coarse, (shape[1], shape[0]), interpolation=cv2.INTER_CUBIC)
    return np.exp(sigma * fine / fine.std()).astype(np.float32)
