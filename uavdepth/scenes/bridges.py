"""Bridges to fly under: footbridges, road bridges, and gantries that carry pipes or signs."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from uavdepth.scenes.fences import FenceKind, add_fence
from uavdepth.scenes.mesh import MeshBuilder
from uavdepth.scenes.solids import Point, add_box

_STEP_M = 0.17


def add_bridge(
    builder: MeshBuilder,
    rng: np.random.Generator,
    start: Point,
    end: Point,
    ground_m: float,
    clear_m: float,
    width_m: float,
    stairs: bool = True,
    span_m: float = 40.0,
) -> None:
    """A level bridge.

    Args:
        builder: the scene's mesh.
        rng: source of its make.
        start, end: ends of its middle line, north and east in metres.
        ground_m: height of the ground, up positive.
        clear_m: free height below its deck.
        width_m: of the deck.
        stairs: whether steps lead down at both ends, in its line.
        span_m: greatest distance between piers.
    """
    low = np.array([*start, -(ground_m + clear_m)])
    high = np.array([*end, -(ground_m + clear_m)])
    along = (high - low) / np.linalg.norm(high - low)
    across = np.array([-along[1], along[0], 0.0])
    thick = float(rng.uniform(0.35, 0.8))
    texture = str(rng.choice(["concrete", "concrete", "paint", "planks"]))
    tint = rng.uniform(0.4, 1.0) * np.ones(3) if texture == "paint" else np.ones(3)
    turn = float(np.arctan2(along[1], along[0]))
    length = float(np.linalg.norm(high - low))
    bottom = ground_m + clear_m
    middle = 0.5 * (low + high)
    add_box(builder, (middle[0], middle[1]), (length, width_m), bottom, bottom + thick, texture, tint, turn)
    _add_underside(builder, low, high, across * 0.5 * width_m)
    for part in np.linspace(0.0, 1.0, int(np.ceil(length / span_m)) + 1):
        for side in (-0.35, 0.35):
            pier = low + part * (high - low) + side * width_m * across
            add_box(builder, (pier[0], pier[1]), (0.45, 0.45), ground_m - 1.0, bottom, "concrete", tint, turn)
    rail: FenceKind = "railing" if rng.random() < 0.6 else "mesh"
    for side in (-0.5, 0.5):
        line = np.array([low, high]) + (side * (width_m - 0.16)) * across - [0.0, 0.0, thick]
        add_fence(builder, rng, line, rail, 1.15)
    if stairs:
        for foot, outwards in ((low, -along), (high, along)):
            _add_stairs(builder, rng, foot, outwards, width_m, ground_m, bottom + thick)


def _add_underside(
    builder: MeshBuilder, low: NDArray[np.float64], high: NDArray[np.float64], half: NDArray[np.float64]
) -> None:
    """What one sees from below; boxes have no bottom."""
    corners = [low - half, high - half, high + half, low + half]
    uv = np.array(corners)[:, :2]
    builder.add(corners, [(0, 2, 1), (0, 3, 2)], uv, "concrete", (0.9, 0.9, 0.9))


def _add_stairs(
    builder: MeshBuilder,
    rng: np.random.Generator,
    top: ArrayLike,
    outwards: NDArray[np.float64],
    width_m: float,
    ground_m: float,
    top_m: float,
) -> None:
    """A flight of steps down from the deck's end."""
    steps = int((top_m - ground_m) / _STEP_M)
    turn = float(np.arctan2(outwards[1], outwards[0]))
    foot = np.asarray(top, float)
    for number in range(steps):
        place = foot + outwards * 0.3 * (number + 0.5)
        level = top_m - (number + 1) * (top_m - ground_m) / (steps + 1)
        add_box(
            builder,
            (place[0], place[1]),
            (0.3, width_m),
            max(level - 0.3, ground_m),
            level,
            "concrete",
            (0.95, 0.95, 0.95),
            turn,
        )
    last = foot + outwards * 0.3 * steps
    across = np.array([-outwards[1], outwards[0], 0.0]) * (0.5 * width_m - 0.08)
    for side in (-across, across):
        line = [np.array([*(foot + side)[:2], -top_m]), np.array([*(last + side)[:2], -ground_m])]
        add_fence(builder, rng, line, "handrail", 1.0)
