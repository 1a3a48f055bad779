"""Grows the control points of a clear flight path, step by step, by looking around with rays."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

STEP_S = 0.5
"""Time between the control points of a flight's splines."""
MIN_SPEED_MPS, MAX_SPEED_MPS = 1.0, 8.0
MAX_ACCELERATION_MPS2 = 3.0
CLEARANCE_M = 1.2
MIN_HEIGHT_M, MAX_HEIGHT_M = 1.5, 40.0

_MARGIN_M = CLEARANCE_M + 0.3
"""Control points keep more than the clearance, since the curve between them is checked at samples."""
_BRAKING_MPS2 = 1.6
_CLIMB_LIMIT_MPS = 2.5
_START_CANDIDATES = 128
_MAX_STEPS_BACK = 60
_AROUND = np.array(
    [
        (n, e, d)
        for n in (-1.0, 0.0, 1.0)
        for e in (-1.0, 0.0, 1.0)
        for d in (-1.0, 0.0, 1.0)
        if (n, e, d) != (0, 0, 0)
    ]
)
_HEADINGS = np.arange(24) * (2 * math.pi / 24)


class World(Protocol):
    """What the planner asks a scene."""

    @property
    def extent_m(self) -> float: ...
    def ground_height_m(self, north_m: float, east_m: float) -> float: ...
    def ray_distance_m(self, origin_ned_m: ArrayLike, direction_ned: ArrayLike) -> NDArray[np.floating]: ...
    def clearance_m(self, position_ned_m: Sequence[float]) -> float: ...


@dataclass(frozen=True)
class Habit:
    """How one flight is flown: what makes flights differ.

    Args:
        low_m, high_m: band of heights above ground that it wanders through.
        wander_rate_radps, wander_phase_rad: of the slow wave between them.
        cruise_mps: speed in the open.
    """

    low_m: float
    high_m: float
    wander_rate_radps: float
    wander_phase_rad: float
    cruise_mps: float

    @classmethod
    def draw(cls, rng: np.random.Generator) -> Habit:
        """Two of three flights stay within about 2 to 10 m, where obstacles are."""
        style = rng.random()
        if style < 0.65:
            low, high = rng.uniform(1.8, 5.0), rng.uniform(4.0, 10.0)
        elif style < 0.88:
            low, high = rng.uniform(3.0, 10.0), rng.uniform(8.0, 20.0)
        else:
            low, high = rng.uniform(8.0, 25.0), rng.uniform(20.0, 37.0)
        low, high = min(low, high), max(low, high)
        return cls(low, high, rng.uniform(0.15, 0.6), rng.uniform(0, 2 * math.pi), rng.uniform(1.5, 7.8))

    def height_m(self, t_s: float) -> float:
        """Wanted height above ground at `t_s`."""
        wave = 0.5 + 0.5 * math.sin(self.wander_rate_radps * t_s + self.wander_phase_rad)
        return self.low_m + (self.high_m - self.low_m) * wave


class PathGrower:
    """Grows one path. Its steps keep to speed and acceleration limits by construction.

    Args:
        world: the scene.
        rng: source of every choice.
    """

    def __init__(self, world: World, rng: np.random.Generator) -> None:
        self._world = world
        self._rng = rng
        self._habit = Habit.draw(rng)
        self._reach = 0.9 * world.extent_m
        self._goal_rad = 0.0
        self._goal_age = 0

    def grow(self, count: int) -> NDArray[np.float64] | None:
        """(count, 3) NED control points `STEP_S` apart, or None where no clear path was found."""
        start = self._start()
        if start is None:
            return None
        self._pick_goal(start, course=self._rng.uniform(0, 2 * math.pi), turn_deg=180.0)
        free = float(self._free_along(start, np.array([self._goal_rad]))[0])
        speed = min(self._habit.cruise_mps, max(MIN_SPEED_MPS, self._braking_speed(free)))
        first_step = speed * STEP_S * np.array([math.cos(self._goal_rad), math.sin(self._goal_rad), 0.0])
        path = [start, start + first_step]
        if not self._is_open(path[0], path[1]):
            return None
        steps_back = 0
        while len(path) < count:
            following = self._next(path)
            if following is not None:
                path.append(following)
                continue
            steps_back += 1
            if steps_back > _MAX_STEPS_BACK:
                return None
            del path[max(2, len(path) - int(self._rng.integers(2, 7))) :]
            self._pick_goal(path[-1], self._course(path), turn_deg=90.0)
        return np.array(path)

    def _start(self) -> NDArray[np.float64] | None:
        """A free place with the open sky above, the likelier the more things stand 3 to 20 m around it."""
        rng, world = self._rng, self._world
        places = np.empty((_START_CANDIDATES, 3))
        places[:, :2] = rng.uniform(-0.9 * self._reach, 0.9 * self._reach, (_START_CANDIDATES, 2))
        height = self._habit.height_m(0.0)
        places[:, 2] = [-world.ground_height_m(north, east) - height for north, east, _ in places]
        fan = _HEADINGS[::2]
        rays = np.column_stack([np.cos(fan), np.sin(fan), np.zeros(len(fan))])
        rays = np.vstack([rays, [0.0, 0.0, -1.0]])
        distance = self._rays(np.repeat(places, len(rays), axis=0), np.tile(rays, (len(places), 1)))
        distance = distance.reshape(len(places), len(rays))
        around = distance[:, :-1]
        # An open sky proves that the place is outside every building.
        free = np.isinf(distance[:, -1]) & (around.min(axis=1) > 2.0)
        company = ((around > 3.0) & (around < 20.0)).mean(axis=1)
        weight = free * (0.02 + company)
        for _ in range(8):
            if weight.sum() <= 0:
                return None
            pick = int(rng.choice(len(places), p=weight / weight.sum()))
            if world.clearance_m(places[pick].tolist()) > _MARGIN_M:
                return np.array(places[pick])
            weight[pick] = 0.0
        return None

    def _next(self, path: list[NDArray[np.float64]]) -> NDArray[np.float64] | None:
        """The following control point, or None where it would not be clear."""
        here = path[-1]
        velocity = (here - path[-2]) / STEP_S
        course = self._course(path)
        self._goal_age += 1
        if self._goal_age > 4 and self._rng.random() < 0.3:
            self._pick_goal(here, course, turn_deg=55.0)
        free = self._free_along(here, np.array([self._goal_rad]))[0]
        if free < 2.5 + velocity @ velocity / (2 * _BRAKING_MPS2) or self._leaves(here):
            self._pick_goal(here, course, turn_deg=80.0)
            free = self._free_along(here, np.array([self._goal_rad]))[0]
        # A turn of more than 80 degrees at once would stop the vehicle on the way.
        turn = math.remainder(self._goal_rad - course, 2 * math.pi)
        heading = course + max(-math.radians(80), min(math.radians(80), turn))
        brake = self._braking_speed(float(free))
        speed = min(max(min(self._habit.cruise_mps, brake), MIN_SPEED_MPS), MAX_SPEED_MPS - 0.5)
        wanted = np.array([speed * math.cos(heading), speed * math.sin(heading), self._sink(path, velocity)])
        change = wanted - velocity
        limit = np.array([MAX_ACCELERATION_MPS2, 0.6 * MAX_ACCELERATION_MPS2]) * STEP_S * 0.95
        level = math.hypot(change[0], change[1])
        change[:2] *= min(1.0, limit[0] / level) if level > 0 else 1.0
        change[2] = np.clip(change[2], -limit[1], limit[1])
        change *= min(1.0, limit[0] / max(float(np.linalg.norm(change)), 1e-9))
        following = here + (velocity + change) * STEP_S
        if not self._is_open(here, following) or not self._curve_is_clear([*path[-3:], following]):
            return None
        return following

    def _sink(self, path: list[NDArray[np.float64]], velocity: NDArray[np.float64]) -> float:
        """Down speed that leads to the wanted height above the ground a second ahead."""
        ahead = path[-1] + velocity * 1.0
        wanted = self._habit.height_m(len(path) * STEP_S)
        ground = max(self._world.ground_height_m(*path[-1][:2]), self._world.ground_height_m(*ahead[:2]))
        target = -(ground + wanted)
        return float(np.clip((target - path[-1][2]) / 1.5, -_CLIMB_LIMIT_MPS, _CLIMB_LIMIT_MPS))

    def _pick_goal(self, here: NDArray[np.float64], course: float, turn_deg: float) -> None:
        """Draw a new heading among the open ones, rather ahead, rather towards something to look at."""
        free = self._free_along(here, _HEADINGS)
        turn = np.remainder(_HEADINGS - course + math.pi, 2 * math.pi) - math.pi
        weight = np.exp(-0.5 * (turn / math.radians(turn_deg)) ** 2) * np.clip((free - 4.0) / 5.0, 0.0, 1.0)
        weight *= np.where(free > 40.0, 0.45, 1.0)
        out = here[:2] + np.minimum(free, 15.0)[:, None] * np.column_stack(
            [np.cos(_HEADINGS), np.sin(_HEADINGS)]
        )
        weight *= np.where(np.abs(out).max(axis=1) > self._reach, 0.01, 1.0)
        weight += 1e-6 * free.clip(0.0, 50.0)
        self._goal_rad = float(_HEADINGS[int(self._rng.choice(len(_HEADINGS), p=weight / weight.sum()))])
        self._goal_age = 0

    def _free_along(self, here: NDArray[np.float64], headings: NDArray[np.floating]) -> NDArray[np.float64]:
        """(K,) metres that a body as wide as the clearance can go from `here` along each heading."""
        ahead = np.column_stack([np.cos(headings), np.sin(headings), np.zeros(len(headings))])
        right = np.column_stack([-ahead[:, 1], ahead[:, 0], ahead[:, 2]])
        down = np.array([0.0, 0.0, 1.0])
        offsets = [0.0 * right, 1.1 * right, -1.1 * right, 0.0 * right + 0.9 * down, 0.0 * right - 1.1 * down]
        origins = np.concatenate([here + offset for offset in offsets])
        distance = self._rays(origins, np.tile(ahead, (len(offsets), 1)))
        return np.asarray(distance.reshape(len(offsets), -1).min(axis=0))

    def _is_open(self, start: NDArray[np.float64], end: NDArray[np.float64]) -> bool:
        """Whether nothing stands between two control points and a margin beyond."""
        step = end - start
        length = float(np.linalg.norm(step))
        if length < 1e-6:
            return True
        return bool(self._rays(start[None], step[None] / length)[0] > length + _MARGIN_M)

    def _curve_is_clear(self, control: list[NDArray[np.float64]]) -> bool:
        """Whether the newest piece of the curve keeps its distance and its height."""
        points = [control[-1]]
        if len(control) == 4:
            a, b, c, d = control
            points = [(a + 4 * b + c) / 6, (a + 23 * b + 23 * c + d) / 48, (b + 4 * c + d) / 6]
        for point in points:
            height = -point[2] - self._world.ground_height_m(point[0], point[1])
            if not MIN_HEIGHT_M + 0.1 < height < MAX_HEIGHT_M - 0.5:
                return False
        # Rays all around are quick; the exact clearance of the whole path is tested at the end.
        origins = np.repeat(np.array(points), len(_AROUND), axis=0)
        return bool(self._rays(origins, np.tile(_AROUND, (len(points), 1))).min() > _MARGIN_M)

    def _leaves(self, here: NDArray[np.float64]) -> bool:
        ahead = here[:2] + 6.0 * np.array([math.cos(self._goal_rad), math.sin(self._goal_rad)])
        return bool(np.abs(ahead).max() > max(self._reach, np.abs(here[:2]).max()))

    @staticmethod
    def _braking_speed(free_m: float) -> float:
        return math.sqrt(2 * _BRAKING_MPS2 * max(free_m - 2.0, 0.0))

    @staticmethod
    def _course(path: list[NDArray[np.float64]]) -> float:
        step = path[-1] - path[-2]
        return math.atan2(step[1], step[0])

    def _rays(self, origins: NDArray[np.float64], directions: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(self._world.ray_distance_m(origins, directions), float)
