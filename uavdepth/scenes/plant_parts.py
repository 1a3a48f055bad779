"""What stands in an industrial yard: tanks, silos, pipes, halls, containers, heaps."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from uavdepth.scenes.bars import add_bars
from uavdepth.scenes.buildings import add_gable
from uavdepth.scenes.fences import add_fence
from uavdepth.scenes.lattice import add_lattice
from uavdepth.scenes.mesh import MeshBuilder
from uavdepth.scenes.shapes import tube
from uavdepth.scenes.solids import Point, Rect, add_box, add_boxes

_SIDES = 18
_METAL = np.array([0.85, 0.87, 0.9])


def add_cylinder(
    builder: MeshBuilder,
    foot: Point,
    bottom_m: float,
    top_m: float,
    radius_m: float,
    texture: str,
    tint: ArrayLike,
    cone_m: float = 0.0,
    foot_radius_m: float | None = None,
) -> None:
    """An upright cylinder with a lid that rises by `cone_m` to its middle; a funnel where the foot's radius
    differs. Heights over down = 0."""
    low = radius_m if foot_radius_m is None else foot_radius_m
    points = [(*foot, -bottom_m), (*foot, -top_m), (*foot, -top_m - max(cone_m, 0.02))]
    (vertices, faces), uv = tube(points, [low, radius_m, 0.02], _SIDES)
    lid = (np.arange(len(faces)) // _SIDES) % 2 == 1
    wall_tint = np.asarray(tint, float)
    builder.add(vertices, faces, uv, texture, np.where(lid[:, None], 0.92 * wall_tint, wall_tint))


def add_tank(
    builder: MeshBuilder, rng: np.random.Generator, north_m: float, east_m: float, radius_m: float
) -> None:
    """A storage tank with a railing around its roof and a ladder."""
    height = float(radius_m * rng.uniform(0.8, 2.2))
    texture = str(rng.choice(["paint", "plaster", "corrugated"]))
    tint = _METAL * rng.uniform(0.7, 1.2) * rng.uniform(0.93, 1.07, 3)
    add_cylinder(builder, (north_m, east_m), 0.0, height, radius_m, texture, tint, 0.12 * radius_m)
    turn = np.linspace(0.0, 2 * np.pi, 13)
    edge = radius_m - 0.15
    ring = np.column_stack(
        [north_m + edge * np.cos(turn), east_m + edge * np.sin(turn), np.full(13, -height)]
    )
    add_fence(builder, rng, ring, "handrail", 1.1)
    _add_ladder(builder, np.array([north_m + radius_m + 0.2, east_m, 0.0]), height + 1.0)


def _add_ladder(builder: MeshBuilder, foot: ArrayLike, height_m: float) -> None:
    low = np.asarray(foot, float)
    aside, up = np.array([0.0, 0.25, 0.0]), np.array([0.0, 0.0, -1.0])
    rails = np.array([low - aside, low + aside])
    add_bars(builder, rails, rails + height_m * up, 0.025)
    rungs = low + np.arange(0.3, height_m, 0.3)[:, None] * up
    add_bars(builder, rungs - aside, rungs + aside, 0.015, sides=3)


def add_silo(
    builder: MeshBuilder, rng: np.random.Generator, north_m: float, east_m: float, radius_m: float
) -> None:
    """A silo on legs, a funnel below it."""
    clear, height = float(rng.uniform(2.5, 4.5)), float(rng.uniform(7.0, 16.0))
    tint = _METAL * rng.uniform(0.7, 1.15)
    texture = "corrugated" if rng.random() < 0.5 else "paint"
    top = clear + height
    place = (north_m, east_m)
    add_cylinder(builder, place, clear + 1.2, top, radius_m, texture, tint, 0.5 * radius_m)
    add_cylinder(builder, place, clear - 0.6, clear + 1.2, radius_m, texture, tint, 0.0, 0.25)
    turn = np.arange(4) * 0.5 * np.pi + 0.25 * np.pi
    feet = np.column_stack(
        [north_m + 0.95 * radius_m * np.cos(turn), east_m + 0.95 * radius_m * np.sin(turn), 0 * turn]
    )
    tops = feet - [0.0, 0.0, clear + 1.4]
    add_bars(builder, feet, tops, 0.12)
    add_bars(builder, feet, np.roll(tops, 1, axis=0), 0.04)
    _add_ladder(builder, np.array([north_m + radius_m + 0.2, east_m, 0.0]), top)


def add_pipe_bridge(
    builder: MeshBuilder, rng: np.random.Generator, start: Point, end: Point, clear_m: float
) -> None:
    """Pipes and cable trays side by side on frames, `clear_m` above the ground."""
    low, high = np.array([*start, 0.0]), np.array([*end, 0.0])
    length = float(np.linalg.norm(high - low))
    along = (high - low) / length
    across = np.array([-along[1], along[0], 0.0])
    up = np.array([0.0, 0.0, -1.0])
    half = float(rng.uniform(0.9, 1.6))
    frames = low + np.linspace(0.0, length, max(2, round(length / 7.0) + 1))[:, None] * along
    steel = rng.uniform(0.3, 0.7) * np.array([1.0, 1.0, 1.0])
    decks = (0.0, 1.2) if rng.random() < 0.5 else (0.0,)
    for side in (-half, half):
        legs = frames + side * across
        add_bars(builder, legs - 0.2 * up, legs + (clear_m + decks[-1] + 0.3) * up, 0.13, steel)
        for level in decks:
            add_bars(
                builder, legs[:-1] + (clear_m + level) * up, legs[1:] + (clear_m + level) * up, 0.1, steel
            )
    for level in decks:
        beams = frames + (clear_m + level) * up
        add_bars(builder, beams - half * across, beams + half * across, 0.1, steel)
        place = -half + 0.25
        while place < half - 0.1:
            radius = float(rng.uniform(0.06, 0.24))
            line = low + (place + radius) * across + (clear_m + level + 0.1 + radius) * up
            tint = rng.choice([0.5, 0.8, 1.1]) * rng.uniform(0.8, 1.1, 3)
            add_bars(builder, line, line + length * along, radius, tint, sides=8)
            place += 2 * radius + rng.uniform(0.1, 0.4)


def add_hall(
    builder: MeshBuilder, rng: np.random.Generator, plot: Rect, height_m: float, front_only: bool = False
) -> None:
    """A hall of sheet metal with a roof of two slopes or a flat one; gates and a band of windows on its
    southern front, and on the northern one too unless `front_only`."""
    tint = rng.uniform(0.8, 1.15) * rng.uniform(0.9, 1.1, 3)
    texture = str(rng.choice(["corrugated", "corrugated", "panel_facade", "brick"]))
    centre = (0.5 * (plot.north_low_m + plot.north_high_m), 0.5 * (plot.east_low_m + plot.east_high_m))
    size = (plot.north_high_m - plot.north_low_m, plot.east_high_m - plot.east_low_m)
    add_box(builder, centre, size, -0.2, height_m, texture, tint, top_texture="gravel")
    if rng.random() < 0.6:
        add_gable(builder, rng, plot.shrunk(-0.1), height_m + 0.02, texture, tint, "corrugated")
    else:
        vents = np.column_stack(
            [rng.uniform(plot.north_low_m + 2, plot.north_high_m - 2, 5), rng.uniform(-0.4, 0.4, 5)]
        )
        vents[:, 1] = centre[1] + vents[:, 1] * size[1]
        add_boxes(builder, vents, (1.6, 1.6), np.full(5, height_m), rng.uniform(0.8, 2.0), "paint")
    for north in (plot.north_low_m,) if front_only else (plot.north_low_m, plot.north_high_m):
        for east in np.arange(plot.east_low_m + 4.0, plot.east_high_m - 4.0, rng.uniform(7.0, 11.0)):
            wide, high = rng.uniform(3.0, 4.5), rng.uniform(3.2, min(5.0, height_m - 1.5))
            color = rng.uniform(0.4, 1.1, 3)
            add_box(builder, (north, float(east)), (0.12, wide), 0.0, high, "corrugated", color)
        band = (0.08, size[1] - 3.0)
        add_box(builder, (north, centre[1]), band, height_m - 1.3, height_m - 0.5, "car_glass")


def add_containers(builder: MeshBuilder, rng: np.random.Generator, place: Rect) -> None:
    """Rows of stacked containers of 20 and 40 feet, one to four high."""
    north = place.north_low_m + 1.5
    while north < place.north_high_m - 1.5:
        east = place.east_low_m
        while east < place.east_high_m - 6.1:
            length = 12.19 if rng.random() < 0.5 and east < place.east_high_m - 12.2 else 6.06
            for level in range(int(rng.integers(0, 5))):
                tint = rng.uniform(0.4, 1.2, 3)
                bottom = 2.6 * level
                spot = (north + rng.normal(0.0, 0.03), east + 0.5 * length)
                add_box(builder, spot, (2.44, length), bottom, bottom + 2.59, "corrugated", tint)
            east += length + 0.3
        north += 2.44 + (0.3 if rng.random() < 0.5 else 4.5)


def add_heap(builder: MeshBuilder, rng: np.random.Generator, north_m: float, east_m: float) -> None:
    """A heap of gravel, sand or scrap."""
    radius, height = float(rng.uniform(2.0, 6.0)), float(rng.uniform(1.2, 3.5))
    turn = np.arange(14) * 2 * np.pi / 14
    rings = []
    for level in (1.0, 0.6, 0.25):
        out = radius * level * rng.uniform(0.85, 1.15, 14)
        rise = height * (1.0 - level) ** 0.8 - (0.2 if level == 1.0 else 0.0)
        rings.append(
            np.column_stack([north_m + out * np.cos(turn), east_m + out * np.sin(turn), np.full(14, -rise)])
        )
    vertices = np.vstack([*rings, [(north_m, east_m, -height)]])
    here, after = np.arange(14), (np.arange(14) + 1) % 14
    faces = [np.stack([here + 28, after + 28, np.full(14, 42)], axis=1)]
    for ring in (0, 14):
        faces.append(np.stack([here + ring, after + ring, here + ring + 14], axis=1))
        faces.append(np.stack([after + ring, after + ring + 14, here + ring + 14], axis=1))
    texture = str(rng.choice(["gravel", "sand", "soil", "scree"]))
    builder.add(vertices, np.concatenate(faces), vertices[:, :2], texture, np.full(3, rng.uniform(0.8, 1.1)))


def add_platform(builder: MeshBuilder, rng: np.random.Generator, plot: Rect, height_m: float) -> None:
    """A steel platform on columns with a railing, a vessel on it, open below."""
    ring = plot.corners
    steel = np.full(3, rng.uniform(0.3, 0.6))
    middles = [((a[0] + b[0]) / 2, (a[1] + b[1]) / 2) for a, b in zip(ring, ring[1:] + ring[:1], strict=True)]
    feet = np.array([(*spot, 0.0) for spot in ring + middles])
    up = np.array([0.0, 0.0, -1.0])
    add_bars(builder, feet, feet + height_m * up, 0.12, steel)
    centre = (0.5 * (plot.north_low_m + plot.north_high_m), 0.5 * (plot.east_low_m + plot.east_high_m))
    size = (plot.north_high_m - plot.north_low_m, plot.east_high_m - plot.east_low_m)
    add_box(builder, centre, size, height_m, height_m + 0.15, "concrete")
    low = [(*spot, -height_m) for spot in ring]
    builder.add(low, [(0, 2, 1), (0, 3, 2)], ring, "concrete", (0.7, 0.7, 0.7))
    add_fence(builder, rng, [(*spot, -height_m - 0.15) for spot in [*ring, ring[0]]], "railing", 1.1)
    radius = 0.28 * min(size)
    top = height_m + float(rng.uniform(2.0, 5.0))
    add_cylinder(builder, centre, height_m + 0.15, top, radius, "paint", _METAL * rng.uniform(0.7, 1.1), 0.4)
    if rng.random() < 0.5:
        stack = np.array([centre[0] + 0.3 * size[0], centre[1], -height_m])
        add_bars(builder, stack, stack + rng.uniform(6.0, 14.0) * up, 0.3, _METAL, sides=8)
    if rng.random() < 0.4:
        corner = np.array([*ring[0], 0.0])
        add_lattice(builder, corner, corner + (height_m + 5.0) * up, (0.6, 0.6), 0.04, steel)
