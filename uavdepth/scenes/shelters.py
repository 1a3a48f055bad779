"""Roofs on posts: covered walks, carports, awnings, market stalls, bus shelters."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from uavdepth.scenes.bars import add_bars
from uavdepth.scenes.mesh import MeshBuilder
from uavdepth.scenes.solids import Point, Rect, add_box

Vector = NDArray[np.float64]


def add_canopy(
    builder: MeshBuilder,
    corners_ned_m: Vector,
    thick_m: float,
    texture: str,
    tint: Vector | tuple[float, float, float],
) -> None:
    """A flat or sloping sheet with an edge: (4, 3) corners of its top in a ring."""
    top = np.asarray(corners_ned_m, float)
    vertices = np.vstack([top, top + np.array([0.0, 0.0, thick_m])])
    first, second = np.linalg.norm(top[1] - top[0]), np.linalg.norm(top[3] - top[0])
    sheet = np.array([(0.0, 0.0), (first, 0.0), (first, second), (0.0, second)])
    quads = [(0, 1, 2, 3), (7, 6, 5, 4), (0, 4, 5, 1), (1, 5, 6, 2), (2, 6, 7, 3), (3, 7, 4, 0)]
    # Seen from above, rings of north over east run anticlockwise; turn them so that the top faces up.
    flat = np.cross(top[1] - top[0], top[3] - top[0])[2]
    faces = np.array([face for a, b, c, d in quads for face in ((a, b, c), (a, c, d))])
    uv = np.vstack([sheet, sheet + thick_m])
    builder.add(vertices, faces if flat < 0 else faces[:, ::-1], uv, texture, tint)


def add_covered_walk(
    builder: MeshBuilder,
    rng: np.random.Generator,
    start: Point,
    end: Point,
    ground_m: float,
    width_m: float,
    columns_on: tuple[float, ...] = (-0.5, 0.5),
) -> None:
    """A roof over a way, on columns or posts.

    Args:
        builder: the scene's mesh.
        rng: source of its make.
        start, end: ends of its middle line, north and east in metres.
        ground_m: height of the ground, up positive.
        width_m: of the roof.
        columns_on: rows of columns, as parts of the width from the middle line.
    """
    low, high = np.array(start), np.array(end)
    length = float(np.linalg.norm(high - low))
    along = (high - low) / length
    across = np.array([-along[1], along[0]])
    turn = float(np.arctan2(along[1], along[0]))
    height, thick = float(rng.uniform(2.7, 3.6)), float(rng.uniform(0.15, 0.5))
    stout = rng.random() < 0.5
    texture = str(rng.choice(["concrete", "plaster", "brick"])) if stout else "paint"
    tint = rng.uniform(0.75, 1.1) * np.ones(3) if stout else rng.uniform(0.2, 0.9) * np.ones(3)
    roof = str(rng.choice(["concrete", "plaster"])) if stout else str(rng.choice(["corrugated", "planks"]))
    for place in np.linspace(0.25, length - 0.25, max(2, round(length / rng.uniform(2.5, 4.5)) + 1)):
        for row in columns_on:
            foot = low + place * along + row * (width_m - 0.5) * across
            size = 0.38 if stout else 0.12
            add_box(
                builder,
                (foot[0], foot[1]),
                (size, size),
                ground_m,
                ground_m + height,
                texture,
                tint,
                turn,
            )
    half = 0.5 * width_m * across
    ring = np.array([low - half, high - half, high + half, low + half])
    top = np.column_stack([ring, np.full(4, -(ground_m + height + thick))])
    add_canopy(builder, top, thick, roof, tint if stout else np.full(3, 0.9))


def add_awning(
    builder: MeshBuilder, rng: np.random.Generator, start: Point, end: Point, outwards: Point, ground_m: float
) -> None:
    """A cloth over a shop window, from `start` to `end` on the wall, reaching `outwards` (a unit vector)."""
    height, reach = ground_m + rng.uniform(2.5, 2.9), rng.uniform(0.9, 1.8)
    wall = np.array([[*start, -height], [*end, -height]])
    edge = wall + reach * np.array([*outwards, 0.0]) + [0.0, 0.0, rng.uniform(0.25, 0.5)]
    add_canopy(
        builder, np.array([wall[0], wall[1], edge[1], edge[0]]), 0.04, "fabric", rng.uniform(0.2, 1.1, 3)
    )


def add_stall(
    builder: MeshBuilder,
    rng: np.random.Generator,
    north_m: float,
    east_m: float,
    ground_m: float,
    turn_rad: float,
) -> None:
    """A market stall: four posts, a cloth roof with two slopes, tables and crates."""
    length, width = rng.uniform(2.2, 3.5), rng.uniform(1.8, 2.4)
    height, ridge = rng.uniform(2.1, 2.4), rng.uniform(0.3, 0.6)
    ahead = np.array([np.cos(turn_rad), np.sin(turn_rad), 0.0])
    right = np.array([-ahead[1], ahead[0], 0.0])
    foot = np.array([north_m, east_m, -ground_m])
    up = np.array([0.0, 0.0, -1.0])
    corners = [
        foot + 0.5 * (a * length * ahead + b * width * right) for a, b in ((1, 1), (1, -1), (-1, -1), (-1, 1))
    ]
    add_bars(builder, corners, np.array(corners) + height * up, 0.03, (0.7, 0.7, 0.7))
    cloth = rng.uniform(0.25, 1.1, 3)
    peak = [foot + 0.55 * a * length * ahead + (height + ridge) * up for a in (1, -1)]
    for side in (1, -1):
        eaves = [foot + 0.55 * (a * length * ahead + side * width * right) + height * up for a in (1, -1)]
        add_canopy(builder, np.array([peak[0], peak[1], eaves[1], eaves[0]]), 0.03, "fabric", cloth)
    table = (float(foot[0]), float(foot[1]))
    size = (length * 0.9, width * 0.6)
    add_box(builder, table, size, ground_m, ground_m + 0.8, "planks", turn_rad=turn_rad)
    for _ in range(4):
        spot = foot + rng.uniform(-0.35, 0.35) * length * ahead + rng.uniform(-0.2, 0.2) * width * right
        color = rng.uniform(0.3, 1.1, 3)
        add_box(
            builder,
            (spot[0], spot[1]),
            (0.5, 0.35),
            ground_m + 0.8,
            ground_m + 1.05,
            "board",
            color,
            turn_rad,
        )


def add_bus_shelter(
    builder: MeshBuilder, north_m: float, east_m: float, ground_m: float, turn_rad: float
) -> None:
    """A glass shelter of four metres, its open side along `turn_rad`."""
    ahead = np.array([np.cos(turn_rad), np.sin(turn_rad)])
    right = np.array([-ahead[1], ahead[0]])
    back = np.array([north_m, east_m]) - 0.65 * ahead

    def box(place: Vector, size: tuple[float, float], low: float, high: float, texture: str) -> None:
        tint = (0.4, 0.42, 0.44) if texture == "paint" else (1.2, 1.2, 1.2)
        add_box(builder, (place[0], place[1]), size, ground_m + low, ground_m + high, texture, tint, turn_rad)

    box(back, (0.03, 4.0), 0.25, 2.2, "car_glass")
    for side in (-2.0, 0.0, 2.0):
        box(back + side * right, (0.08, 0.08), 0.0, 2.3, "paint")
    for side in (-2.0, 2.0):
        box(back + side * right + 0.6 * ahead, (1.1, 0.03), 0.25, 2.1, "board")
    box(back + 0.35 * ahead, (0.4, 3.0), 0.42, 0.48, "paint")
    roof = back + 0.65 * ahead
    box(roof, (1.7, 4.4), 2.3, 2.42, "paint")


def add_carport(builder: MeshBuilder, rng: np.random.Generator, place: Rect, ground_m: float) -> None:
    """A roof for one car over a rectangle on the ground."""
    height = ground_m + float(rng.uniform(2.2, 2.7))
    texture, tint = ("planks", np.ones(3)) if rng.random() < 0.6 else ("paint", np.full(3, 0.4))
    for north, east in place.shrunk(0.15).corners:
        add_box(builder, (north, east), (0.12, 0.12), ground_m, height, texture, tint)
    tilt = np.array([0.0, 0.0, 0.2, 0.2]) * rng.choice([0.0, 1.0])
    ring = np.array([(*corner, -height) for corner in place.corners])
    ring[:, 2] -= 0.12 + tilt
    add_canopy(builder, ring, 0.12, str(rng.choice(["corrugated", "planks", "gravel"])), np.ones(3))
