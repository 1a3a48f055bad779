"""`wall`: one long wall across open ground."""

from __future__ import annotations

import numpy as np

from uavdepth.scenes.cars import CarPark
from uavdepth.scenes.corridor import Corridor
from uavdepth.scenes.description import SceneDescription
from uavdepth.scenes.fences import FENCE_KINDS, add_fence
from uavdepth.scenes.mesh import MeshBuilder
from uavdepth.scenes.overhead import add_line, add_mast
from uavdepth.scenes.people import Crowd
from uavdepth.scenes.plots import add_patches, patch_lines
from uavdepth.scenes.solids import add_box
from uavdepth.scenes.street_furniture import add_lamp, add_sign, add_small_thing
from uavdepth.scenes.terrain import level_ground
from uavdepth.scenes.undergrowth import add_bush
from uavdepth.scenes.vegetation import add_tree
from uavdepth.scenes.weather import draw_weather

_WALLS = ("brick", "concrete", "corrugated", "plaster", "panel_facade", "brick_facade")
_GROUNDS = ("grass", "gravel", "asphalt", "concrete", "soil", "paving")
_HALF_M = 90.0
_HORIZON_M = 700.0
_CORRIDOR_M = 4.0


def build(seed: int) -> SceneDescription:
    """The wall of one seed, frontal to the origin 31 to 44 m north of it."""
    rng = np.random.default_rng([seed, 0x3A11])
    builder = MeshBuilder()
    north_m = float(rng.uniform(31.0, 44.0))
    height_m = 3.0 * int(rng.integers(3, 7))
    ground = str(rng.choice(_GROUNDS))
    lines = patch_lines(_HALF_M, 12.0, _HORIZON_M)
    add_patches(builder, lines, lambda _: (ground, np.full(3, rng.uniform(0.85, 1.1))))
    half = float(rng.uniform(20.0, 70.0))
    tint = rng.uniform(0.8, 1.1) * rng.uniform(0.93, 1.07, 3)
    texture = str(rng.choice(_WALLS))
    add_box(
        builder, (north_m + 1.5, 0.0), (3.0, 2 * half), 0.0, height_m, texture, tint, top_texture="concrete"
    )
    for east_m in np.arange(-half + 4.0, half, rng.uniform(7.0, 14.0)):
        if rng.random() < 0.5:
            add_box(builder, (north_m - 0.15, float(east_m)), (0.3, 0.6), 0.0, height_m, "concrete", tint)
    _add_things(builder, rng, north_m)
    _add_thin_things(builder, seed, north_m)
    weather = draw_weather(rng, (0.0005, 0.006))
    return weather.over(builder.build(), level_ground, _HALF_M - 15.0)


def _add_things(builder: MeshBuilder, rng: np.random.Generator, wall_m: float) -> None:
    """Boxes, containers, poles, cars and trees beside the corridor and behind the start."""
    cars = CarPark(rng)
    for _ in range(int(rng.integers(25, 60))):
        north, east = rng.uniform(-_HALF_M + 10, _HALF_M - 10, 2)
        in_corridor = -8.0 < north < wall_m + 1.0 and abs(east) < _CORRIDOR_M + 3.0
        if in_corridor or abs(north - wall_m - 1.5) < 5.0:
            continue
        kind = int(rng.integers(7))
        if kind == 0:
            size = rng.uniform(0.5, 2.5, 3)
            texture = str(rng.choice(["concrete", "corrugated", "brick", "board"]))
            add_box(
                builder,
                (north, east),
                (size[0], size[1]),
                0.0,
                size[2],
                texture,
                rng.uniform(0.7, 1.1, 3),
                rng.uniform(0, 3),
            )
        elif kind == 1:
            add_box(
                builder,
                (north, east),
                (6.06, 2.44),
                0.0,
                2.59,
                "corrugated",
                rng.uniform(0.5, 1.1, 3),
                rng.uniform(0, 3),
            )
        elif kind == 2:
            turn = rng.uniform(0, 2 * np.pi)
            add_lamp(builder, rng, north, east, 0.0, (float(np.cos(turn)), float(np.sin(turn))))
        elif kind == 3:
            cars.park(north, east, 0.0, rng.uniform(0, 2 * np.pi))
        elif kind == 4:
            add_tree(builder, rng, north, east, 0.0, rng.uniform(4.0, 9.0))
        elif kind == 5:
            add_sign(builder, rng, north, east, 0.0, rng.uniform(0, np.pi))
            add_small_thing(builder, rng, north + 1.5, east, 0.0)
        else:
            add_bush(builder, rng, north, east, 0.0, rng.uniform(0.8, 2.0))
    cars.build(builder)


def _add_thin_things(builder: MeshBuilder, seed: int, wall_m: float) -> None:
    """A line of poles, fences, masts, a few people: from a random stream of their own."""
    rng = np.random.default_rng([seed, 0x7419])
    corridor = Corridor(wall_m)
    if rng.random() < 0.5:
        east = rng.choice([-1.0, 1.0]) * rng.uniform(15.0, 45.0)
        norths = np.arange(-80.0, wall_m - 6.0, rng.uniform(20.0, 35.0))
        feet = np.column_stack([norths, np.full_like(norths, east), 0.0 * norths])
        add_line(builder, rng, feet, "wood" if rng.random() < 0.6 else "concrete")
    for _ in range(int(rng.integers(0, 4))):
        start = rng.uniform(-70.0, 70.0, 2)
        turn = rng.integers(4) * 0.5 * np.pi + rng.normal(0.0, 0.1)
        end = start + rng.uniform(8.0, 30.0) * np.array([np.cos(turn), np.sin(turn)])
        if corridor.is_free((start[0], start[1]), (end[0], end[1])):
            kind = FENCE_KINDS[int(rng.integers(len(FENCE_KINDS)))]
            add_fence(builder, rng, [(*start, 0.0), (*end, 0.0)], kind)
    crowd = Crowd(rng)
    for _ in range(int(rng.integers(2, 9))):
        place = rng.uniform(-60.0, 60.0, 2)
        if corridor.is_free_around(place, 1.5)[0] and abs(place[0] - wall_m - 1.5) > 2.5:
            if rng.random() < 0.4:
                add_mast(builder, rng, place[0], place[1], 0.0)
            else:
                crowd.put(place[0], place[1], 0.0, rng.uniform(0, 2 * np.pi))
    crowd.build(builder)
