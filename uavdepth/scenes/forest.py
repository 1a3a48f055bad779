"""The scene `forest`: many kinds of trees, leafy or bare, undergrowth, fallen logs, a trail, a clearing."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from uavdepth.scenes.copies import Template, add_copies
from uavdepth.scenes.description import SceneDescription
from uavdepth.scenes.groves import add_tree_wall, tree_template
from uavdepth.scenes.mesh import MeshBuilder
from uavdepth.scenes.rocks import add_boulder
from uavdepth.scenes.shapes import box_uv, grid_faces
from uavdepth.scenes.terrain import LandNoise, Values, fractal_land, level_ground, stretched_axis
from uavdepth.scenes.undergrowth import add_bush, add_log, add_tuft
from uavdepth.scenes.vegetation import TreeKind, add_far_tree
from uavdepth.scenes.weather import draw_weather

_EXTENT_M = 68.0
_PLANTED_M = 78.0
_FAR_M = 170.0
_GROUND_REACH_M = 600.0
_CORRIDOR_HALF_WIDTH_M = 3.2
_CLEARING_M = 5.0
_WALL_HALF_WIDTH_M = 14.0
_VARIETIES = 6
"""Templates of each kind of tree."""


@dataclass(frozen=True)
class _Wood:
    """What grows in one kind of forest.

    Args:
        kinds: tree kinds and their shares.
        floors: textures of the ground, the first where the noise is lowest.
        autumn: share of coloured leaves.
        spacing_m: mean distance between trees.
    """

    kinds: dict[TreeKind, float]
    floors: tuple[str, str, str]
    autumn: float
    spacing_m: tuple[float, float]


_WOODS = (
    _Wood(
        {"broadleaf": 0.75, "birch": 0.12, "dead": 0.05, "conifer": 0.08},
        ("grass", "leaf_litter", "moss"),
        0.05,
        (4.8, 6.6),
    ),
    _Wood(
        {"conifer": 0.85, "birch": 0.08, "dead": 0.07},
        ("moss", "needle_floor", "needle_floor"),
        0.0,
        (4.4, 6.0),
    ),
    _Wood({"birch": 0.65, "broadleaf": 0.2, "conifer": 0.15}, ("grass", "grass", "moss"), 0.25, (4.4, 6.2)),
    _Wood(
        {"broadleaf": 0.6, "birch": 0.25, "poplar": 0.1, "dead": 0.05},
        ("leaf_litter", "leaf_litter", "soil"),
        0.8,
        (4.8, 6.6),
    ),
    _Wood(
        {"conifer": 0.4, "broadleaf": 0.4, "poplar": 0.1, "birch": 0.1},
        ("needle_floor", "leaf_litter", "grass"),
        0.1,
        (4.6, 6.2),
    ),
    _Wood({"snowy_conifer": 0.75, "dead": 0.25}, ("snow", "snow", "snow"), 0.0, (4.4, 6.2)),
)
_WINTER_WOODS = (
    _Wood(
        {"bare": 0.8, "birch": 0.05, "conifer": 0.15},
        ("leaf_litter", "leaf_litter", "moss"),
        0.8,
        (4.8, 6.6),
    ),
    _Wood({"bare": 0.75, "dead": 0.05, "snowy_conifer": 0.2}, ("snow", "snow", "snow"), 0.0, (4.6, 6.4)),
)
_WINTER_CHANCE = 0.16
_WOOD_SHARES = (0.22, 0.2, 0.17, 0.14, 0.17, 0.1)


def build(seed: int) -> SceneDescription:
    """The forest of one seed."""
    rng = np.random.default_rng([seed, 0xF0E])
    wood = _WOODS[int(rng.choice(len(_WOODS), p=_WOOD_SHARES))]
    winter = np.random.default_rng([seed, 0xB1E])
    if winter.random() < _WINTER_CHANCE:
        wood = _WINTER_WOODS[int(winter.integers(len(_WINTER_WOODS)))]
    wall_north_m = rng.uniform(34.0, 39.0)
    builder = MeshBuilder()
    _add_floor(builder, rng, wood)
    _add_trees(builder, rng, wood, wall_north_m)
    if rng.random() < 0.35:
        _add_rock_bank(builder, rng, wall_north_m)
    else:
        kind: TreeKind = "snowy_conifer" if "snowy_conifer" in wood.kinds else "conifer"
        add_tree_wall(builder, rng, kind, wood.autumn, wall_north_m, _WALL_HALF_WIDTH_M)
    _add_undergrowth(builder, rng, wood, wall_north_m)
    _add_far_trees(builder, rng, wood)
    weather = draw_weather(rng, (0.001, 0.009))
    return weather.over(builder.build(), level_ground, _EXTENT_M)


def _trail_east_m(bends: LandNoise, north_m: ArrayLike) -> Values:
    """The trail's middle line: straight north of the origin, winding south of it."""
    north = np.asarray(north_m, float)
    winding = 9.0 * (bends.at(north, np.zeros_like(north)) - bends.at(0.0, 0.0))
    return np.asarray(np.where(north < 0.0, winding * np.minimum(-north / 12.0, 1.0), 0.0))


def _add_floor(builder: MeshBuilder, rng: np.random.Generator, wood: _Wood) -> None:
    lines = stretched_axis(_EXTENT_M + 12.0, 1.1, _GROUND_REACH_M, growth=1.3)
    north, east = np.meshgrid(lines, lines, indexing="ij")
    # Corners off the grid's lines hide the grid where one texture meets another.
    shake = (np.hypot(north, east) < _EXTENT_M + 10.0) * rng.uniform(-0.28, 0.28, (2, *north.shape))
    vertices = np.stack([north + shake[0], east + shake[1], np.zeros_like(north)], axis=-1).reshape(-1, 3)
    faces = grid_faces(len(lines), len(lines))
    middle = vertices[faces].mean(axis=1)
    patches = fractal_land(rng, middle[:, 0], middle[:, 1], 14.0, 3)
    low, middling, high = wood.floors
    texture = np.full(len(faces), middling, dtype="<U16")
    texture[patches < -0.22] = low
    texture[patches > 0.3] = high
    bends = LandNoise(rng, 30.0)
    off = np.abs(middle[:, 1] - _trail_east_m(bends, middle[:, 0]))
    if wood.floors[0] != "snow":
        texture[(off < 1.0 + 0.5 * patches) & (middle[:, 0] < 33.0)] = "soil"
    tint = np.ones(3) * (1.0 + 0.22 * fractal_land(rng, middle[:, 0], middle[:, 1], 9.0, 3))[:, None]
    for name in np.unique(texture):
        part = texture == name
        builder.add(vertices, faces[part], vertices[:, :2], str(name), tint[part])


def _jittered_places(rng: np.random.Generator, reach_m: float, spacing_m: float) -> NDArray[np.float64]:
    """(K, 2) places about `spacing_m` apart, without rows."""
    lines = np.arange(-reach_m, reach_m, spacing_m)
    north, east = np.meshgrid(lines, lines, indexing="ij")
    places = np.stack([north, east], axis=-1).reshape(-1, 2)
    return places + rng.uniform(-0.42, 0.42, places.shape) * spacing_m


def _is_free(places: NDArray[np.float64], reach_m: ArrayLike, wall_north_m: float) -> NDArray[np.bool_]:
    """(K,) True where a thing of that reach keeps clearing and corridor free, and stands not in the wall."""
    north, east = places[:, 0], np.abs(places[:, 1])
    reach = np.asarray(reach_m, float)
    clear = np.hypot(north, east) > _CLEARING_M + reach
    before = (north > -2.0) & (north < wall_north_m + 1.0)
    corridor = before & (east < _CORRIDOR_HALF_WIDTH_M + reach)
    wall = (north > wall_north_m - 3.0) & (north < wall_north_m + 13.0) & (east < _WALL_HALF_WIDTH_M + 3.0)
    return np.asarray(clear & ~corridor & ~wall)


def _on_ground(places: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.column_stack([places, np.zeros(len(places))])


def _add_trees(builder: MeshBuilder, rng: np.random.Generator, wood: _Wood, wall_north_m: float) -> None:
    places = _jittered_places(rng, _PLANTED_M, rng.uniform(*wood.spacing_m))
    glades = LandNoise(rng, 24.0).at(places[:, 0], places[:, 1])
    places = places[glades + rng.normal(0.0, 0.15, len(places)) > -0.42]
    heights = np.clip(rng.lognormal(np.log(10.5), 0.34, len(places)), 4.5, 20.0)
    kinds = list(wood.kinds)
    species = rng.choice(len(kinds), size=len(places), p=list(wood.kinds.values()))
    variety = rng.integers(_VARIETIES, size=len(places))
    for number, kind in enumerate(kinds):
        for which in range(_VARIETIES):
            template = tree_template(rng, kind, float(rng.uniform(7.0, 14.0)), wood.autumn)
            here = (species == number) & (variety == which)
            here &= _is_free(places, template.reach * heights, wall_north_m)
            add_copies(builder, rng, template, _on_ground(places[here]), heights[here])


def _add_rock_bank(builder: MeshBuilder, rng: np.random.Generator, north_m: float) -> None:
    """A rocky rise about 10 m high, steep towards the origin, with rocks piled before it."""
    profile = np.array(
        [(1.6, -0.3), (2.0, 2.5), (2.6, 5.0), (3.2, 7.5), (4.2, 9.8), (7.0, 10.4), (10.0, 6.5), (13.0, -0.3)]
    )
    east = np.linspace(-_WALL_HALF_WIDTH_M - 4.0, _WALL_HALF_WIDTH_M + 4.0, 27)
    ends = np.clip((_WALL_HALF_WIDTH_M + 4.5 - np.abs(east)) / 5.0, 0.1, 1.0)
    vertices = np.empty((len(profile), len(east), 3))
    vertices[..., 0] = north_m + profile[:, None, 0]
    vertices[..., 1] = east
    vertices[..., 2] = -profile[:, None, 1] * ends
    vertices[1:-1] += rng.uniform(-0.45, 0.45, vertices[1:-1].shape)
    faces = grid_faces(len(profile), len(east))
    flat = vertices.reshape(-1, 3)
    tint = rng.uniform(0.8, 1.2)
    builder.add(flat, faces, box_uv(flat, faces), "rock", np.full(3, tint))
    for level, spacing in enumerate((2.6, 2.8, 3.2)):
        for east_m in np.arange(-_WALL_HALF_WIDTH_M, _WALL_HALF_WIDTH_M + 0.1, spacing):
            size = rng.uniform(3.5, 6.0)
            place = north_m + 0.4 * size + 0.9 * level + rng.uniform(-0.4, 0.4)
            add_boulder(builder, rng, place, east_m, -3.1 * level, size, sunk=0.2, tint=tint)


def _add_undergrowth(
    builder: MeshBuilder, rng: np.random.Generator, wood: _Wood, wall_north_m: float
) -> None:
    for _ in range(5):
        height = rng.uniform(0.7, 1.8)
        plant = partial(add_bush, rng=rng, north_m=0.0, east_m=0.0, ground_down_m=0.0, height_m=height)
        bush = Template.of(partial(plant, autumn=wood.autumn), height)
        places = rng.uniform(-_PLANTED_M, _PLANTED_M, (int(rng.integers(12, 40)), 2))
        heights = np.clip(rng.lognormal(0.0, 0.4, len(places)), 0.4, 2.6)
        free = _is_free(places, bush.reach * heights, wall_north_m)
        add_copies(builder, rng, bush, _on_ground(places[free]), heights[free])
    if "snow" not in wood.floors:
        for _ in range(4):
            blades = str(rng.choice(["grass", "leaves"]))
            tuft = Template.of(partial(add_tuft, rng=rng, height_m=0.5, texture=blades), 0.5)
            places = rng.uniform(-_EXTENT_M, _EXTENT_M, (220, 2))
            places = places[np.abs(places[:, 1]) > 1.5]
            add_copies(builder, rng, tuft, _on_ground(places), rng.uniform(0.25, 0.7, len(places)))
    for place in _scattered(rng, int(rng.integers(14, 34)), 4.0, wall_north_m):
        add_log(builder, rng, place[0], place[1], 0.0, rng.uniform(3.0, 9.0), rng.uniform(0.12, 0.38))
    for place in _scattered(rng, int(rng.integers(20, 70)), 2.0, wall_north_m):
        size = float(np.clip(rng.lognormal(-0.1, 0.6), 0.3, 4.0))
        add_boulder(builder, rng, place[0], place[1], 0.0, size, sunk=rng.uniform(0.25, 0.45))


def _scattered(
    rng: np.random.Generator, count: int, reach_m: float, wall_north_m: float
) -> NDArray[np.float64]:
    places = rng.uniform(-_PLANTED_M, _PLANTED_M, (count, 2))
    return places[_is_free(places, reach_m, wall_north_m)]


def _add_far_trees(builder: MeshBuilder, rng: np.random.Generator, wood: _Wood) -> None:
    """The wood goes on to the horizon."""
    places = _jittered_places(rng, _FAR_M, 8.0)
    places = places[np.abs(places).max(axis=1) > _PLANTED_M]
    kinds = list(wood.kinds)
    which = rng.integers(_VARIETIES, size=len(places))
    for number in range(_VARIETIES):
        kind = kinds[int(rng.choice(len(kinds), p=list(wood.kinds.values())))]
        template = Template.of(partial(add_far_tree, rng=rng, height_m=12.0, kind=kind), 12.0)
        here = places[which == number]
        add_copies(builder, rng, template, _on_ground(here), rng.uniform(8.0, 18.0, len(here)))
