"""Where the pictures of the open part are taken: random poses, and flights of different kinds."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from uavdepth.attitude import Attitude
from uavdepth.errors import SceneError
from uavdepth.scenes import Scene
from uavdepth.scenes.flight import Pose

_HEIGHT_M = (1.5, 8.0)
_CLEARANCE_M = 1.0
_TRIES = 2_000
_FACING_SHARE = 0.7
_FACING_M = (2.0, 20.0)
_FACING_TRIES = 200
_TILT_RAD = math.radians(7.0)
_LARGEST_TILT_RAD = math.radians(25.0)

SPEEDS_MPS = (1.0, 2.0, 3.0, 4.5, 6.0)
TURN_RATES_DPS = (30.0, 60.0, 90.0)


class Manoeuvre(StrEnum):
    """What the vehicle does."""

    CRUISE = "cruise"
    TURN = "turn"
    HOVER = "hover"


_ROW = (Manoeuvre.CRUISE, Manoeuvre.TURN, Manoeuvre.HOVER, Manoeuvre.CRUISE, Manoeuvre.CRUISE)


@dataclass(frozen=True)
class Trajectory:
    """A flight to be looked at.

    Args:
        manoeuvre: its kind.
        speed_mps: its mean speed; 0 in a hover or turn on the spot.
        turn_dps: its fastest turn, degrees a second.
        duration_s: its length.
        pose_at: the vehicle at a time from the start.
    """

    manoeuvre: Manoeuvre
    speed_mps: float
    turn_dps: float
    duration_s: float
    pose_at: Callable[[float], Pose]


def random_pose(scene: Scene, rng: np.random.Generator) -> Pose:
    """A pose near the ground, free of everything by a metre, with any heading and some tilt.

    Most look at something near: over open ground a scan has nothing to miss.

    Raises:
        SceneError: no free place is found.
    """
    reach_m = 0.9 * scene.extent_m
    faces_something = rng.random() < _FACING_SHARE
    for number in range(_TRIES):
        north_m, east_m = rng.uniform(-reach_m, reach_m, 2)
        up_m = scene.ground_height_m(north_m, east_m) + rng.uniform(*_HEIGHT_M)
        position = np.array([north_m, east_m, -up_m])
        yaw = float(rng.uniform(-math.pi, math.pi))
        heading = np.array([math.cos(yaw), math.sin(yaw), 0.0])
        ahead_m = float(scene.ray_distance_m(position, heading)[0])
        if faces_something and number < _FACING_TRIES and not _FACING_M[0] <= ahead_m <= _FACING_M[1]:
            continue
        below_m = scene.rangefinder_m(position.tolist())
        if below_m is None or scene.clearance_m(position.tolist()) < _CLEARANCE_M:
            continue
        roll, pitch = np.clip(rng.normal(0.0, _TILT_RAD, 2), -_LARGEST_TILT_RAD, _LARGEST_TILT_RAD)
        attitude = Attitude(float(roll), float(pitch), yaw)
        return Pose(position, np.zeros(3), attitude)
    raise SceneError(f"no free place in {scene.name}:{scene.seed} after {_TRIES} tries")


def trajectory(scene: Scene, seed: int, number: int, duration_s: float) -> Trajectory:
    """One of a row of flights: cruises at the speeds of `SPEEDS_MPS`, turns, hovers.

    Args:
        scene: where.
        seed: of the row.
        number: in the row.
        duration_s: its length.
    """
    rng = np.random.default_rng([seed, number, 0xF11E])
    kind = _ROW[number % len(_ROW)]
    if kind is Manoeuvre.CRUISE:
        speed_mps = SPEEDS_MPS[(2 * number + seed) % len(SPEEDS_MPS)]
        return cruise(scene, int(rng.integers(1 << 30)), speed_mps, duration_s)
    if kind is Manoeuvre.TURN:
        return turn(random_pose(scene, rng), TURN_RATES_DPS[seed % len(TURN_RATES_DPS)], duration_s)
    return hover(random_pose(scene, rng), rng, duration_s)


def cruise(scene: Scene, seed: int, speed_mps: float, duration_s: float) -> Trajectory:
    """A planned flight through the scene, flown at a mean speed."""
    flight = scene.flight(seed, max(2.0 * duration_s, 4.0))
    middle_s = 0.5 * flight.duration_s
    own_mps = float(
        np.mean([np.linalg.norm(flight.at(t).velocity_ned_mps) for t in np.linspace(0, middle_s, 9)])
    )
    # Flown slower than planned the tilt that acceleration and drag ask for is less than the planned one;
    # what is measured here is seeing, and a little more tilt than needed makes it no easier.
    pace = min(speed_mps / max(own_mps, 0.1), flight.duration_s / duration_s)

    def pose_at(t_s: float) -> Pose:
        pose = flight.at(t_s * pace)
        return Pose(pose.position_ned_m, pose.velocity_ned_mps * pace, pose.attitude)

    return Trajectory(Manoeuvre.CRUISE, own_mps * pace, 0.0, duration_s, pose_at)


def turn(start: Pose, rate_dps: float, duration_s: float) -> Trajectory:
    """To and fro on the spot, through zero each way, at a rate that is reached in the middle."""
    sweep_rad = math.radians(60.0)
    pulse = math.radians(rate_dps) / sweep_rad

    def pose_at(t_s: float) -> Pose:
        yaw = start.attitude.yaw_rad + sweep_rad * math.sin(pulse * t_s)
        level = Attitude(
            0.3 * start.attitude.roll_rad, 0.3 * start.attitude.pitch_rad, math.remainder(yaw, math.tau)
        )
        return Pose(start.position_ned_m, np.zeros(3), level)

    return Trajectory(Manoeuvre.TURN, 0.0, rate_dps, duration_s, pose_at)


def hover(start: Pose, rng: np.random.Generator, duration_s: float) -> Trajectory:
    """On one spot with the small unrest that wind and control give."""
    rates = rng.uniform(1.0, 4.0, 5)
    phases = rng.uniform(0.0, math.tau, 5)

    def pose_at(t_s: float) -> Pose:
        sway = np.sin(rates * t_s + phases)
        position = start.position_ned_m + 0.15 * sway[:3]
        velocity = 0.15 * rates[:3] * np.cos(rates[:3] * t_s + phases[:3])
        tilt = 0.03 * sway[3:]
        return Pose(position, velocity, Attitude(float(tilt[0]), float(tilt[1]), start.attitude.yaw_rad))

    return Trajectory(Manoeuvre.HOVER, 0.0, 0.0, duration_s, pose_at)
