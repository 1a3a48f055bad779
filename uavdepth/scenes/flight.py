"""Smooth flights through a scene, clear of its obstacles, with the attitude that their accelerations need."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavdepth.attitude import Attitude
from uavdepth.errors import SceneError
from uavdepth.scenes.path_growth import (
    CLEARANCE_M,
    MAX_HEIGHT_M,
    MIN_HEIGHT_M,
    STEP_S,
    PathGrower,
    World,
)

GRAVITY_MPS2 = 9.81
DRAG_PER_S = 0.2
"""Air drag by mass and speed: about 9 degrees of tilt at 8 m/s, as small multirotors show."""
TILT_LIMIT_DEG = 30.0
_TRIES = 40
_LOOK_RATE_LIMIT_RADPS = math.radians(70.0)


@dataclass(frozen=True)
class Pose:
    """Where a vehicle is at one moment.

    Args:
        position_ned_m: (3,) north, east, down in metres.
        velocity_ned_mps: (3,) in metres a second.
        attitude: of the body.
    """

    position_ned_m: NDArray[np.float64]
    velocity_ned_mps: NDArray[np.float64]
    attitude: Attitude


@dataclass(frozen=True)
class Sway:
    """Small smooth unrest of the attitude: a sum of sines for roll and one for pitch.

    Args:
        amplitudes_rad, rates_radps, phases_rad: (2, K) each.
    """

    amplitudes_rad: NDArray[np.float64]
    rates_radps: NDArray[np.float64]
    phases_rad: NDArray[np.float64]

    def at(self, t_s: float) -> tuple[float, float]:
        """Roll and pitch to add at `t_s`, radians."""
        waves = self.amplitudes_rad * np.sin(self.rates_radps * t_s + self.phases_rad)
        return float(waves[0].sum()), float(waves[1].sum())


@dataclass(frozen=True)
class Flight:
    """A path of uniform cubic B-splines: velocity and acceleration are continuous, and acceleration is
    bounded by the second differences of the control points.

    Args:
        duration_s: how long it lasts.
        control_ned_m: (N, 3) control points, `STEP_S` apart.
        control_yaw_rad: (N,) unwrapped yaw of the nose.
        sway: unrest of the attitude.
    """

    duration_s: float
    control_ned_m: NDArray[np.float64]
    control_yaw_rad: NDArray[np.float64]
    sway: Sway

    def at(self, t_s: float) -> Pose:
        """The vehicle at `t_s` seconds from the start; before the start and after the end it hangs there."""
        inside = 0.0 <= t_s <= self.duration_s
        t = min(max(t_s, 0.0), self.duration_s)
        position, velocity, acceleration = _spline(self.control_ned_m, t)
        if not inside:
            velocity, acceleration = np.zeros(3), np.zeros(3)
        yaw = float(_spline(self.control_yaw_rad[:, None], t)[0][0])
        return Pose(position, velocity, self._attitude(t, velocity, acceleration, yaw))

    def _attitude(
        self, t_s: float, velocity: NDArray[np.float64], acceleration: NDArray[np.float64], yaw: float
    ) -> Attitude:
        """Point the thrust along what gravity, acceleration and drag ask for."""
        down = np.array([0.0, 0.0, GRAVITY_MPS2]) - acceleration - DRAG_PER_S * velocity
        ahead = math.cos(yaw) * down[0] + math.sin(yaw) * down[1]
        right = -math.sin(yaw) * down[0] + math.cos(yaw) * down[1]
        more_roll, more_pitch = self.sway.at(t_s)
        roll = -math.atan2(right, math.hypot(ahead, down[2])) + more_roll
        pitch = math.atan2(ahead, down[2]) + more_pitch
        tilt = math.degrees(math.acos(math.cos(roll) * math.cos(pitch)))
        ease = min(1.0, TILT_LIMIT_DEG / tilt) if tilt > 0 else 1.0
        return Attitude(roll * ease, pitch * ease, math.remainder(yaw, 2 * math.pi))


def plan_flight(scene: World, seed: int, duration_s: float) -> Flight:
    """A flight of `duration_s` through `scene`, the same for the same seed.

    Most flights stay low, 2 to 10 m above the ground, and near things, since that is where obstacle
    avoidance happens. The path grows control point by control point towards headings that rays find free,
    takes steps back out of dead ends, and is accepted only when every part of it is clear.

    Raises:
        SceneError: a duration that is not positive and finite, or no clear path found.
    """
    if not (math.isfinite(duration_s) and 0 < duration_s <= 3600):
        raise SceneError(f"a flight of {duration_s} s: above 0 up to 3600 s is needed")
    for attempt in range(_TRIES):
        rng = np.random.default_rng([seed & 0xFFFFFFFF, attempt, 0xF11])
        control = PathGrower(scene, rng).grow(math.ceil(duration_s / STEP_S) + 3)
        if control is not None and _is_clear(scene, control, duration_s):
            return Flight(duration_s, control, _yaw(rng, control), _sway(rng))
    raise SceneError(f"no clear path of {duration_s} s found in {_TRIES} tries")


def _spline(control: NDArray[np.float64], t_s: float) -> tuple[NDArray[np.float64], ...]:
    """Position, velocity and acceleration of a uniform cubic B-spline, (D,) each."""
    last = len(control) - 4
    segment = min(int(t_s / STEP_S), last)
    u = t_s / STEP_S - segment
    p0, p1, p2, p3 = control[segment : segment + 4]
    v = 1 - u
    b0, b1, b2, b3 = v**3 / 6, (3 * u**3 - 6 * u**2 + 4) / 6, (3 * v**3 - 6 * v**2 + 4) / 6, u**3 / 6
    position = b0 * p0 + b1 * p1 + b2 * p2 + b3 * p3
    d0, d1, d2 = v * v / 2, (1 + 2 * u - 2 * u * u) / 2, u * u / 2
    velocity = (d0 * (p1 - p0) + d1 * (p2 - p1) + d2 * (p3 - p2)) / STEP_S
    acceleration = (v * (p2 - 2 * p1 + p0) + u * (p3 - 2 * p2 + p1)) / STEP_S**2
    return position, velocity, acceleration


def _is_clear(scene: World, control: NDArray[np.float64], duration_s: float) -> bool:
    times = np.linspace(0.0, duration_s, max(2, math.ceil(duration_s / 0.1)))
    path = np.array([_spline(control, t)[0] for t in times])
    moved = np.concatenate([[np.inf], np.linalg.norm(np.diff(path, axis=0), axis=1)])
    margin = -1.0
    for position, step in zip(path, moved, strict=True):
        # Clearance shrinks no faster than the vehicle moves, so far from things most samples need no query.
        margin -= step
        if margin < CLEARANCE_M + 0.05:
            margin = scene.clearance_m(position.tolist())
            if margin < CLEARANCE_M + 0.05:
                return False
        height = -position[2] - scene.ground_height_m(position[0], position[1])
        if not MIN_HEIGHT_M <= height <= MAX_HEIGHT_M:
            return False
    return True


def _yaw(rng: np.random.Generator, control: NDArray[np.float64]) -> NDArray[np.float64]:
    """Nose along the path, looking a little around, never turning faster than a camera drone does."""
    step = np.diff(control[:, :2], axis=0)
    step = np.vstack([step, step[-1:]])
    course = np.unwrap(np.arctan2(step[:, 1], step[:, 0]))
    t = np.arange(len(control)) * STEP_S
    look = np.zeros(len(control))
    for _ in range(2):
        look += math.radians(rng.uniform(2.0, 14.0)) * np.sin(rng.uniform(0.3, 1.1) * t + rng.uniform(0, 6.3))
    if rng.random() < 0.15:
        look += math.radians(rng.uniform(-70.0, 70.0))
    wanted = course + look
    yaw = np.empty_like(wanted)
    yaw[0] = wanted[0]
    most = _LOOK_RATE_LIMIT_RADPS * STEP_S
    for k in range(1, len(wanted)):
        yaw[k] = yaw[k - 1] + np.clip(0.7 * (wanted[k] - yaw[k - 1]), -most, most)
    return yaw


def _sway(rng: np.random.Generator) -> Sway:
    rates = rng.uniform(1.0, 9.0, (2, 4))
    amplitudes = np.radians(rng.uniform(0.2, 1.6)) * rng.uniform(0.3, 1.0, (2, 4)) / (1.0 + 0.3 * rates)
    return Sway(amplitudes, rates, rng.uniform(0.0, 2 * np.pi, (2, 4)))
