"""Where the training pictures are taken: along flights, and on approaches to whatever stands ahead."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from training.data.thin_approach import approach_thin
from uavdepth.attitude import Attitude

FLIGHT_DURATION_S = 40.0
_APPROACH_SPREAD_M = 20.0
SAFE_CLEARANCE_M = 0.5
APPROACH_SHARE = 0.45
"""Share of pictures taken right before an obstacle: a flight that keeps clear of them shows too few."""
APPROACH_DISTANCE_M = (1.5, 40.0)
MAX_EXTRA_TILT_RAD = math.radians(25.0)
_EXTRA_TILT_SHARE = 0.4
_HEIGHT_RANGES_M = ((1.0, 1.5), (1.5, 12.0), (12.0, 40.0))
_HEIGHT_SHARES = (0.1, 0.75, 0.15)
_TRIES = 40


class FlownPose(Protocol):
    """The part of a scene's pose that is needed here."""

    @property
    def position_ned_m(self) -> NDArray[np.float64]: ...

    @property
    def attitude(self) -> Attitude: ...


class FlownFlight(Protocol):
    """A flight through a scene."""

    def at(self, t_s: float) -> FlownPose: ...


class World(Protocol):
    """The part of a scene that poses are sampled from."""

    def ground_height_m(self, north_m: float, east_m: float) -> float: ...

    def ray_distance_m(
        self, origin_ned_m: NDArray[np.float64], direction_ned: NDArray[np.float64]
    ) -> NDArray[np.float64]: ...

    def clearance_m(self, position_ned_m: Sequence[float]) -> float: ...

    def flight(self, seed: int, duration_s: float) -> FlownFlight: ...


SampledPose = tuple[NDArray[np.float64], Attitude]


def sample_poses(
    world: World, rng: np.random.Generator, count: int, thin_share: float = 0.0
) -> list[SampledPose]:
    """`count` camera-carrying vehicle poses, each at least `SAFE_CLEARANCE_M` from everything.

    Args:
        world: to fly in.
        rng: random numbers.
        count: of poses.
        thin_share: of them, taken right before poles, wires and trunks where there are any.
    """
    flight = world.flight(int(rng.integers(1 << 30)), FLIGHT_DURATION_S)
    poses: list[SampledPose] = []
    while len(poses) < count:
        flown = flight.at(float(rng.uniform(0.0, FLIGHT_DURATION_S)))
        if thin_share and rng.random() < thin_share:
            found = _before_something_thin(world, rng, np.asarray(flown.position_ned_m, np.float64))
            if found is not None:
                poses.append((found[0], _tilted(rng, found[1])))
                continue
        if rng.random() < APPROACH_SHARE:
            approach = _approach(world, rng, np.asarray(flown.position_ned_m, np.float64))
            if approach is None:
                continue
            position, attitude = approach
        else:
            position, attitude = np.asarray(flown.position_ned_m, np.float64), flown.attitude
        poses.append((position, _tilted(rng, attitude)))
    return poses


def _approach(world: World, rng: np.random.Generator, start: NDArray[np.float64]) -> SampledPose | None:
    """A pose at a log-uniform distance before something that a level ray from around `start` meets."""
    for _ in range(_TRIES):
        origin = _place_near(world, rng, start)
        yaw = rng.uniform(-math.pi, math.pi)
        heading = np.array([math.cos(yaw), math.sin(yaw), 0.0])
        if world.clearance_m(origin.tolist()) < SAFE_CLEARANCE_M:
            continue
        free_m = float(np.ravel(world.ray_distance_m(origin, heading))[0])
        if not math.isfinite(free_m):
            continue
        wanted_m = math.exp(rng.uniform(*np.log(APPROACH_DISTANCE_M)))
        position = origin + heading * max(free_m - wanted_m, 0.0)
        if world.clearance_m(position.tolist()) < SAFE_CLEARANCE_M:
            continue
        look_yaw = yaw + rng.normal(0.0, math.radians(20.0))
        return position, Attitude(rng.normal(0.0, 0.06), rng.normal(-0.03, 0.08), look_yaw)
    return None


def _before_something_thin(
    world: World, rng: np.random.Generator, start: NDArray[np.float64]
) -> SampledPose | None:
    for _ in range(_TRIES):
        origin = _place_near(world, rng, start)
        if world.clearance_m(origin.tolist()) >= SAFE_CLEARANCE_M:
            found = approach_thin(world, rng, origin, SAFE_CLEARANCE_M)
            if found is not None:
                return found
    return None


def _place_near(world: World, rng: np.random.Generator, start: NDArray[np.float64]) -> NDArray[np.float64]:
    """(3,) NED metres, at a random height above the ground around `start`."""
    heights = _HEIGHT_RANGES_M[rng.choice(len(_HEIGHT_RANGES_M), p=_HEIGHT_SHARES)]
    north, east = start[:2] + rng.normal(0.0, _APPROACH_SPREAD_M, 2)
    ground = float(world.ground_height_m(north, east))
    return np.array([north, east, -ground - rng.uniform(*heights)])


def _tilted(rng: np.random.Generator, attitude: Attitude) -> Attitude:
    """The attitude with extra roll and pitch in some of the pictures: gusts, braking, sharp turns."""
    if rng.random() > _EXTRA_TILT_SHARE:
        return attitude
    roll, pitch = np.clip(rng.normal(0.0, MAX_EXTRA_TILT_RAD / 2, 2), -MAX_EXTRA_TILT_RAD, MAX_EXTRA_TILT_RAD)
    return Attitude(attitude.roll_rad + roll, attitude.pitch_rad + pitch, attitude.yaw_rad)
