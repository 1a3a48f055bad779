"""Scaffolding before a house front."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from uavdepth.scenes.bars import add_bars
from uavdepth.scenes.mesh import MeshBuilder
from uavdepth.scenes.solids import Point, add_boxes

_LIFT_M, _BAY_M, _DEEP_M, _GAP_M = 2.0, 2.5, 0.75, 0.3


def add_scaffold(
    builder: MeshBuilder,
    rng: np.random.Generator,
    start: Point,
    end: Point,
    outwards: Point,
    ground_m: float,
    height_m: float,
) -> None:
    """Frames, decks, guard rails and braces along a wall.

    Args:
        builder: the scene's mesh.
        rng: source of its make.
        start, end: ends of the wall's foot, north and east in metres.
        outwards: unit vector away from the wall.
        ground_m: height of the ground, up positive.
        height_m: of the wall; the scaffold ends one guard rail above it.
    """
    wall, out = np.array([*start, -ground_m], float), np.array([*outwards, 0.0], float)
    along = np.array([*end, -ground_m]) - wall
    length = float(np.linalg.norm(along))
    along = along / length
    up = np.array([0.0, 0.0, -1.0])
    bays, lifts = max(1, round(length / _BAY_M)), max(1, int(height_m / _LIFT_M))
    places = np.linspace(0.0, length, bays + 1)
    top = lifts * _LIFT_M + 1.0
    inner = wall + places[:, None] * along + _GAP_M * out
    outer = inner + _DEEP_M * out
    tint = rng.uniform(0.5, 0.8) * np.ones(3)
    add_bars(builder, np.vstack([inner, outer]), np.vstack([inner, outer]) + top * up, 0.03, tint)
    levels = np.arange(1, lifts + 1) * _LIFT_M
    rails = np.concatenate([levels, levels + 0.5, levels + 1.0])[:, None] * up
    add_bars(builder, outer[0] + rails, outer[-1] + rails, 0.025, tint)
    cross = (levels[:, None, None] * up + inner).reshape(-1, 3)
    add_bars(builder, cross, cross + _DEEP_M * out, 0.025, tint)
    rising = outer[:-1][None, :] + (levels[:, None, None] - _LIFT_M) * up
    every = (np.arange(bays)[None, :] + np.arange(lifts)[:, None]) % 2 == 0
    braces = rising[every]
    add_bars(builder, braces, braces + (length / bays) * along + _LIFT_M * up, 0.02, tint)
    middle = wall + 0.5 * length * along + (_GAP_M + 0.5 * _DEEP_M) * out
    turn = float(np.arctan2(along[1], along[0]))
    decks = np.broadcast_to(middle[:2], (lifts, 2))
    size = (length, _DEEP_M - 0.08)
    add_boxes(builder, decks, size, ground_m + levels - 0.06, 0.05, "planks", turn_rad=turn)
    if rng.random() < 0.35:
        _add_net(builder, rng, outer[0] + 0.05 * out, outer[-1] + 0.05 * out, top - 1.0)


def _add_net(
    builder: MeshBuilder,
    rng: np.random.Generator,
    start: NDArray[np.float64],
    end: NDArray[np.float64],
    height: float,
) -> None:
    """A dust sheet over part of the scaffold's front."""
    far = start + rng.uniform(0.4, 1.0) * (end - start)
    low, high = np.array([0.0, 0.0, -2.0]), np.array([0.0, 0.0, -height])
    length = float(np.linalg.norm(far - start))
    uv = [(0.0, height), (length, height), (length, 2.0), (0.0, 2.0)]
    corners = [start + low, far + low, far + high, start + high]
    color = np.array([(0.5, 0.75, 0.45), (0.95, 0.95, 0.95), (0.8, 0.6, 0.3)])[int(rng.integers(3))]
    builder.add(corners, [(0, 1, 2), (0, 2, 3)], uv, "fabric", color)
