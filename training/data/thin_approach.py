"""Pictures taken right before poles, wires and trunks: what scans miss most and flights show least."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from uavdepth.attitude import Attitude

THIN_DISTANCE_M = (1.2, 20.0)
"""How far before the thing the vehicle is, log-uniform: a pole at 3 m is where a turn comes too late,
and a network that saw thin things only there would tell every one there."""

THICKEST_M = 0.5
"""Trunks and lamp posts are thin, people and letter boxes are not."""

LARGEST_BEARING_RAD = math.radians(40.0)
"""The thing may be anywhere in the picture: at its edge it is missed as often as ahead."""

_BEHIND = 1.3
"""What is seen on either side of it is farther by this at the least."""

_FARTHEST_M = 25.0
_STEP_RAD = math.radians(0.25)
_UPRIGHT_SHARE = 0.3
"""Of the looks go up and down instead of around: for wires, arms of lamps and branches."""

_STEEPEST_RAD = math.radians(25.0)


class RayWorld(Protocol):
    """The part of a scene that is needed here."""

    def ray_distance_m(
        self, origin_ned_m: NDArray[np.float64], direction_ned: NDArray[np.float64]
    ) -> NDArray[np.float64]: ...

    def clearance_m(self, position_ned_m: Sequence[float]) -> float: ...


def approach_thin(
    world: RayWorld, rng: np.random.Generator, origin: NDArray[np.float64], clearance_m: float
) -> tuple[NDArray[np.float64], Attitude] | None:
    """A pose before something thin that is in sight of a place.

    Args:
        world: of the picture.
        rng: random numbers.
        origin: (3,) NED metres, the place.
        clearance_m: the vehicle keeps at least so much from everything.

    Returns:
        Position, NED metres, and attitude; None where nothing thin is within 25 m, or no room before it.
    """
    directions = _upright_fan(rng) if rng.random() < _UPRIGHT_SHARE else _level_fan(rng)
    distances_m = np.ravel(world.ray_distance_m(np.broadcast_to(origin, directions.shape), directions))
    thin = thin_rays(distances_m, _STEP_RAD)
    if not len(thin):
        return None
    ray = int(rng.choice(thin))
    wanted_m = math.exp(rng.uniform(*np.log(THIN_DISTANCE_M)))
    position = origin + directions[ray] * max(float(distances_m[ray]) - wanted_m, 0.0)
    if world.clearance_m(position.tolist()) < clearance_m:
        return None
    yaw = math.atan2(directions[ray, 1], directions[ray, 0])
    yaw += rng.uniform(-LARGEST_BEARING_RAD, LARGEST_BEARING_RAD)
    return position, Attitude(rng.normal(0.0, 0.06), rng.normal(-0.03, 0.08), yaw)


def thin_rays(distances_m: NDArray[np.float64], step_rad: float) -> NDArray[np.intp]:
    """Which rays of a fan meet something at most `THICKEST_M` thick with nothing near on either side.

    Args:
        distances_m: (N,) along rays that are `step_rad` apart, inf where they meet nothing.
        step_rad: angle between two rays.
    """
    found = []
    for ray in np.flatnonzero(distances_m < _FARTHEST_M):
        farther = distances_m > _BEHIND * distances_m[ray]
        before, after = np.flatnonzero(farther[:ray]), np.flatnonzero(farther[ray:])
        if len(before) and len(after):
            rays = after[0] + ray - before[-1] - 1
            if rays * step_rad * distances_m[ray] <= THICKEST_M:
                found.append(ray)
    return np.array(found, dtype=np.intp)


def _level_fan(rng: np.random.Generator) -> NDArray[np.float64]:
    """(N, 3) unit vectors all around, all as steep."""
    azimuths = rng.uniform(-math.pi, math.pi) + np.arange(0.0, 2 * math.pi, _STEP_RAD)
    return _directions(azimuths, np.full(len(azimuths), rng.normal(0.0, 0.1)))


def _upright_fan(rng: np.random.Generator) -> NDArray[np.float64]:
    """(N, 3) unit vectors one above the other."""
    elevations = np.arange(-_STEEPEST_RAD, _STEEPEST_RAD, _STEP_RAD)
    return _directions(np.full(len(elevations), rng.uniform(-math.pi, math.pi)), elevations)


def _directions(azimuths: NDArray[np.float64], elevations: NDArray[np.float64]) -> NDArray[np.float64]:
    level = np.cos(elevations)
    return np.stack([level * np.cos(azimuths), level * np.sin(azimuths), -np.sin(elevations)], axis=1)
