"""What carries wires on a farm: trellises, hop poles, wire fences, low cables, tunnels' hoops."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from uavdepth.scenes.bars import add_bars, add_path_of_bars, add_wires
from uavdepth.scenes.mesh import MeshBuilder
from uavdepth.scenes.solids import Rect

_UP = np.array([0.0, 0.0, -1.0])
_NORTH = np.array([1.0, 0.0, 0.0])
_SINK_M = 0.2
"""Feet of posts below the ground."""

_STEEL_BGR = (0.6, 0.6, 0.62)
_WOOD_BGR = (0.85, 0.85, 0.85)


def add_posts(
    builder: MeshBuilder, rng: np.random.Generator, feet_ned_m: ArrayLike, height_m: float, radius_m: float
) -> None:
    """Upright posts of one kind, (K, 3) feet: wood, concrete or steel."""
    feet = np.asarray(feet_ned_m, float)
    kind = int(rng.integers(3))
    texture, tint = (("bark", _WOOD_BGR), ("concrete", np.full(3, 0.95)), ("paint", _STEEL_BGR))[kind]
    add_bars(builder, feet - _SINK_M * _UP, feet + height_m * _UP, radius_m, tint, texture, sides=6)


def add_trellis(
    builder: MeshBuilder, rng: np.random.Generator, first_ned_m: ArrayLike, last_ned_m: ArrayLike
) -> None:
    """One row of vines' or raspberries' posts with wires along it, and a stay at either end."""
    feet = _along(first_ned_m, last_ned_m, float(rng.uniform(4.0, 6.5)))
    height = float(rng.uniform(1.6, 2.6))
    add_posts(builder, rng, feet, height, float(rng.uniform(0.03, 0.06)))
    for share in np.linspace(rng.uniform(0.35, 0.5), 0.97, int(rng.integers(2, 5))):
        ends = feet + share * height * _UP
        add_wires(builder, ends[:-1], ends[1:], 0.002, 0.005, _STEEL_BGR)
    outwards = (feet[0] - feet[-1]) / np.linalg.norm(feet[0] - feet[-1])
    tops = feet[[0, -1]] + 0.95 * height * _UP
    add_wires(builder, tops, feet[[0, -1]] + np.array([[1.2], [-1.2]]) * outwards, 0.0, 0.006, _STEEL_BGR)


def add_hop_garden(builder: MeshBuilder, rng: np.random.Generator, land: Rect) -> None:
    """Tall poles in rows, wires from top to top both ways; half of the gardens have bines on strings."""
    apart = float(rng.uniform(6.0, 9.0))
    norths = np.arange(land.north_low_m, land.north_high_m + 0.1, apart)
    easts = np.arange(land.east_low_m, land.east_high_m + 0.1, apart)
    height = float(rng.uniform(4.5, 7.0))
    grid = np.stack(
        [*np.meshgrid(norths, easts, indexing="ij"), np.zeros((len(norths), len(easts)))], axis=-1
    )
    add_posts(builder, rng, grid.reshape(-1, 3), height, float(rng.uniform(0.06, 0.12)))
    tops, radius = grid + (height - 0.1) * _UP, float(rng.uniform(0.006, 0.014))
    add_wires(builder, tops[:-1].reshape(-1, 3), tops[1:].reshape(-1, 3), 0.005, radius)
    add_wires(builder, tops[:, :-1].reshape(-1, 3), tops[:, 1:].reshape(-1, 3), 0.005, radius)
    if rng.random() < 0.5:
        lines = np.concatenate([_along(row[0], row[-1], 2.0) for row in tops])
        leafy = rng.random(len(lines)) < 0.8
        thick = rng.uniform(0.05, 0.16, int(leafy.sum()))
        add_bars(builder, lines[leafy] - height * _UP, lines[leafy], thick, texture="leaves", sides=5)


def add_low_cables(
    builder: MeshBuilder, rng: np.random.Generator, first_ned_m: ArrayLike, last_ned_m: ArrayLike
) -> None:
    """Cables from pole to pole at the heights that vehicles fly at: farm supplies, cableways, tie lines."""
    feet = _along(first_ned_m, last_ned_m, float(rng.uniform(5.0, 14.0)))
    feet[:, :2] += rng.normal(0.0, 0.2, (len(feet), 2))
    height = float(rng.uniform(3.0, 8.0))
    add_posts(builder, rng, feet, height, float(rng.uniform(0.05, 0.16)))
    sag, radius = float(rng.uniform(0.0, 0.03)), float(rng.uniform(0.008, 0.024))
    tint = np.full(3, rng.uniform(0.1, 0.7))
    for level_m in rng.uniform(1.2, height - 0.1, int(rng.integers(1, 7))):
        ends = feet + level_m * _UP
        add_wires(builder, ends[:-1], ends[1:], sag, radius, tint)


def add_wire_fence(builder: MeshBuilder, rng: np.random.Generator, corners_ned_m: ArrayLike) -> None:
    """A pasture's fence along (N, 3) corners: posts and two to five strands."""
    corners = np.asarray(corners_ned_m, float)
    height, apart = float(rng.uniform(0.9, 1.6)), float(rng.uniform(2.5, 5.0))
    feet = np.concatenate([_along(corners[i], corners[i + 1], apart) for i in range(len(corners) - 1)])
    add_posts(builder, rng, feet, height, float(rng.uniform(0.03, 0.07)))
    for share in np.linspace(0.35, 0.95, int(rng.integers(2, 6))):
        add_path_of_bars(builder, feet + share * height * _UP, 0.005, _STEEL_BGR, sides=3)


def add_hoops(builder: MeshBuilder, rng: np.random.Generator, land: Rect) -> None:
    """Steel hoops of a tunnel without its foil, north to south, and the purlins along them."""
    half = min(0.5 * (land.east_high_m - land.east_low_m), float(rng.uniform(2.0, 4.5)))
    east, turn = 0.5 * (land.east_low_m + land.east_high_m), np.linspace(0.0, np.pi, 13)
    rise, radius = float(rng.uniform(0.7, 1.1)), float(rng.uniform(0.02, 0.04))
    arc = np.column_stack([0.0 * turn, east - half * np.cos(turn), -rise * half * np.sin(turn)])
    norths = np.arange(land.north_low_m, land.north_high_m, rng.uniform(1.5, 3.0))
    for north in norths:
        add_path_of_bars(builder, arc + north * _NORTH, radius, _STEEL_BGR)
    for knee in (3, 6, 9):
        ends = arc[knee] + norths[[0, -1], None] * _NORTH
        add_path_of_bars(builder, ends, 0.7 * radius, _STEEL_BGR)


def _along(first: ArrayLike, last: ArrayLike, apart_m: float) -> NDArray[np.float64]:
    """(K, 3) points from one to the other, about so far apart, two at least."""
    start, end = np.asarray(first, float), np.asarray(last, float)
    count = max(2, round(float(np.linalg.norm(end - start)) / apart_m) + 1)
    return np.linspace(start, end, count)
