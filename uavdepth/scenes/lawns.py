"""The land of a park: gentle ground, paths, a pond."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from uavdepth.scenes.mesh import MeshBuilder
from uavdepth.scenes.shapes import box_uv
from uavdepth.scenes.terrain import TerrainGrid, Values, fractal_land, smooth_step, stretched_axis

CORE_M, _SPACING_M, _REACH_M = 92.0, 1.3, 700.0
_SLOPE_M = 1.6
"""Height of the ground's waves: slopes of a few degrees."""


@dataclass(frozen=True)
class Pond:
    """An ellipse of water.

    Args:
        north_m, east_m: its middle.
        half_north_m, half_east_m: half axes.
        level_m: height of its water.
    """

    north_m: float
    east_m: float
    half_north_m: float
    half_east_m: float
    level_m: float

    def off(self, north_m: ArrayLike, east_m: ArrayLike) -> Values:
        """0 in the middle, 1 on the shore, more outside."""
        north = (np.asarray(north_m, float) - self.north_m) / self.half_north_m
        east = (np.asarray(east_m, float) - self.east_m) / self.half_east_m
        return np.asarray(np.hypot(north, east))

    def shore(self, off: float, count: int) -> NDArray[np.float64]:
        """(count, 2) places around it at that value of `off`; the first is also the last."""
        turn = np.linspace(0.0, 2 * np.pi, count)
        return np.column_stack(
            [
                self.north_m + off * self.half_north_m * np.cos(turn),
                self.east_m + off * self.half_east_m * np.sin(turn),
            ]
        )


@dataclass(frozen=True)
class Path:
    """A way through the lawns: (N, 2) points about 2 m apart, and half its width."""

    points_m: NDArray[np.float64]
    half_width_m: float

    def distance_m(self, places: ArrayLike) -> Values:
        """(K,) metres from (K, 2) places to its middle line."""
        spots = np.asarray(places, float)
        nearest = np.full(len(spots), np.inf)
        for point in self.points_m:
            nearest = np.minimum(nearest, np.hypot(*(spots - point).T))
        return nearest


class Lawns:
    """Ground, paths and pond of one park.

    Args:
        rng: source of their shapes.
        end_m: the ground is level from the origin to there.
    """

    def __init__(self, rng: np.random.Generator, end_m: float) -> None:
        lines = stretched_axis(CORE_M, _SPACING_M, _REACH_M, growth=1.25)
        north, east = np.meshgrid(lines, lines, indexing="ij")
        height = _SLOPE_M * fractal_land(rng, north, east, rng.uniform(40.0, 70.0), 3)
        # Level around the origin, along the corridor and below what ends it.
        aside = np.hypot(east, np.maximum(-north, 0.0) + np.maximum(north - end_m - 12.0, 0.0))
        height *= smooth_step(aside, 16.0, 34.0)
        side = float(rng.choice([-1.0, 1.0]))
        half = rng.uniform(9.0, 17.0), rng.uniform(9.0, 17.0)
        place = rng.uniform(-50.0, 20.0), side * rng.uniform(32.0, 55.0)
        self.pond = Pond(*place, *half, level_m=-1.0)
        off = self.pond.off(north, east)
        bank = smooth_step(off, 1.02, 1.7)
        bed = self.pond.level_m - 1.2 * (1.0 - np.minimum(off, 1.0) ** 2) + 0.25 * smooth_step(off, 0.9, 1.05)
        height = np.where(off < 1.02, bed, (self.pond.level_m + 0.25) * (1 - bank) + height * bank)
        self.grid = TerrainGrid(lines, lines, height)
        self.paths = [_wander(rng, self.pond) for _ in range(int(rng.integers(3, 6)))]
        self.paths.append(Path(self.pond.shore(1.55, 60), 1.2))

    def height_m(self, north_m: ArrayLike, east_m: ArrayLike) -> Values:
        """Height of the ground, of the water where it covers it."""
        land = self.grid.at(north_m, east_m)
        wet = self.pond.off(north_m, east_m) <= 1.0
        return np.asarray(np.where(wet, np.maximum(land, self.pond.level_m), land))

    def feet(self, places: ArrayLike) -> NDArray[np.float64]:
        """(K, 3) NED points of the ground at (K, 2) places."""
        spots = np.asarray(places, float).reshape(-1, 2)
        return np.column_stack([spots, -self.height_m(spots[:, 0], spots[:, 1])])

    def is_lawn(self, places: ArrayLike, reach_m: ArrayLike) -> NDArray[np.bool_]:
        """(K,) whether things of (K,) reach stand neither on a path nor in the water."""
        spots = np.asarray(places, float).reshape(-1, 2)
        free = self.pond.off(spots[:, 0], spots[:, 1]) > 1.25
        for path in self.paths:
            free &= path.distance_m(spots) > path.half_width_m + np.asarray(reach_m)
        return np.asarray(free)

    def add(self, builder: MeshBuilder, rng: np.random.Generator, lawn: str, paving: str) -> None:
        """The ground in textures `lawn` and `paving`, and the water."""
        vertices, faces = self.grid.triangles()
        middle = vertices[faces].mean(axis=1)
        near = np.abs(middle[:, :2]).max(axis=1) < CORE_M
        on_path = np.zeros(len(faces), bool)
        for path in self.paths:
            on_path[near] |= path.distance_m(middle[near, :2]) < path.half_width_m
        bare = fractal_land(rng, middle[:, 0], middle[:, 1], 12.0, 3) > 0.55
        off = self.pond.off(middle[:, 0], middle[:, 1])
        kinds = np.select([off < 1.06, on_path, bare], [1, 2, 3], 0)
        tint = np.ones(3) * (1.0 + 0.16 * fractal_land(rng, middle[:, 0], middle[:, 1], 18.0, 3))[:, None]
        uv = box_uv(vertices, faces)
        names = (lawn, "gravel", paving, "snow" if lawn == "snow" else "soil")
        for number, name in enumerate(names):
            part = kinds == number
            if part.any():
                used, local = np.unique(faces[part], return_inverse=True)
                builder.add(vertices[used], local.reshape(-1, 3), uv[part], name, tint[part], smooth=True)
        shore = self.pond.shore(1.04, 40)[:-1]
        ring = np.vstack([shore, [(self.pond.north_m, self.pond.east_m)]])
        water = np.column_stack([ring, np.full(len(ring), -self.pond.level_m)])
        around = np.arange(len(shore))
        fan = np.stack([around, (around + 1) % len(shore), np.full_like(around, len(shore))], axis=1)
        ice = lawn == "snow"
        builder.add(water, fan, ring, "snow" if ice else "water", (0.85, 0.85, 0.82) if ice else (1, 1, 1))


def _wander(rng: np.random.Generator, pond: Pond) -> Path:
    """A winding way from one side of the park to another, around the pond."""
    turn = rng.uniform(0.0, 2 * np.pi)
    ahead, aside = np.array([np.cos(turn), np.sin(turn)]), np.array([-np.sin(turn), np.cos(turn)])
    along = np.arange(-1.4 * CORE_M, 1.4 * CORE_M, 2.0)
    swing = rng.uniform(4.0, 14.0) * np.sin(along / rng.uniform(16.0, 34.0) + rng.uniform(0, 6))
    points = along[:, None] * ahead + (rng.uniform(-40.0, 40.0) + swing)[:, None] * aside
    away = points - [pond.north_m, pond.east_m]
    off = pond.off(points[:, 0], points[:, 1])
    push = np.maximum(1.55 / np.maximum(off, 0.05), 1.0)
    return Path(away * push[:, None] + [pond.north_m, pond.east_m], float(rng.uniform(1.1, 2.2)))
