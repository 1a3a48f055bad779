"""`farm`: open fields with trellises, hop poles, low cables, wire fences, orchards, tunnels and a barn."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from uavdepth.scenes.buildings import add_house
from uavdepth.scenes.cars import PAINTS_BGR
from uavdepth.scenes.corridor import Corridor
from uavdepth.scenes.description import SceneDescription
from uavdepth.scenes.fences import FENCE_KINDS, add_fence
from uavdepth.scenes.groves import add_tree_wall, plant, tree_template
from uavdepth.scenes.hedges import add_hedge
from uavdepth.scenes.lorries import fork_lift, lorry
from uavdepth.scenes.mesh import MeshBuilder
from uavdepth.scenes.overhead import add_line, add_mast
from uavdepth.scenes.people import Crowd
from uavdepth.scenes.plant_parts import add_hall, add_heap, add_silo
from uavdepth.scenes.plots import PlotPlan, Site, add_patches, fill_plots, patch_lines
from uavdepth.scenes.solids import Rect
from uavdepth.scenes.stamps import Stamps
from uavdepth.scenes.terrain import level_ground
from uavdepth.scenes.trellises import (
    add_hoops,
    add_hop_garden,
    add_low_cables,
    add_posts,
    add_trellis,
    add_wire_fence,
)
from uavdepth.scenes.vegetation import TreeKind
from uavdepth.scenes.weather import draw_weather

_FIELD_M, _TRACK_M = 27.0, 6.0
_FIELDS = 3
"""Fields from the middle to each side."""

_REACH_M = (_FIELDS + 0.5) * _FIELD_M
_HORIZON_M = 700.0
_SOILS = ("grass", "soil", "grass", "gravel")
_TREES: tuple[TreeKind, ...] = ("broadleaf", "bare", "birch", "poplar", "conifer")


@dataclass(frozen=True)
class _Farm(Site):
    tree: TreeKind
    autumn: float

    def plant(self, places: NDArray[np.float64], low_m: float, high_m: float) -> None:
        """Trees of the farm's kind at (K, 2) places."""
        template = tree_template(self.rng, self.tree, high_m, self.autumn)
        heights = self.rng.uniform(low_m, high_m, len(places))
        free = self.corridor.is_free_around(places, template.reach * heights)
        feet = np.column_stack([places, np.zeros(len(places))])[free]
        plant(self.builder, self.rng, [template], feet, heights[free])


def build(seed: int) -> SceneDescription:
    """The farm of one seed: a barn, a house or a row of trees ends the view to the north."""
    rng = np.random.default_rng([seed, 0xFA23])
    builder = MeshBuilder()
    end_m = float(rng.uniform(33.0, 43.0))
    tree, autumn = _TREES[int(rng.integers(len(_TREES)))], float(rng.choice([0.0, 0.0, 0.7]))
    farm = _Farm(rng, builder, Corridor(end_m, front_depth_m=8.0), tree, autumn)
    _add_ground(farm)
    taken = _add_front(farm, end_m)
    fields = (
        (_vineyard, 0.14), (_hops, 0.1), (_cables, 0.26), (_pasture, 0.14), (_orchard, 0.08),
        (_tunnels, 0.06), (_masts, 0.1), (_yard, 0.06), (_ploughed, 0.06),
    )  # fmt: skip
    fill_plots(farm, PlotPlan(_FIELDS, _FIELD_M, _TRACK_M), fields, taken)
    _add_borders(farm)
    _add_movers(farm)
    weather = draw_weather(rng, (0.0005, 0.006))
    return weather.over(builder.build(), level_ground, _REACH_M - 15.0)


def _add_ground(farm: _Farm) -> None:
    """Fields of grass, soil or stubble, each of its own tint, and the land around."""
    rng = farm.rng
    kinds = rng.choice(_SOILS, size=3)

    def look(_: bool) -> tuple[str, ArrayLike]:
        tint = rng.uniform(0.8, 1.15) * rng.uniform(0.95, 1.05, 3)
        return str(kinds[int(rng.integers(3))]), tint

    add_patches(farm.builder, patch_lines(_REACH_M, 0.5 * _FIELD_M, _HORIZON_M), look)


def _add_front(farm: _Farm, end_m: float) -> Rect:
    """What ends the view; returns the land that it takes."""
    rng, half = farm.rng, float(farm.rng.uniform(13.5, 20.0))
    kind = rng.choice(["barn", "house", "trees"])
    plot = Rect(end_m, end_m + 13.0, -half, half)
    if kind == "barn":
        add_hall(farm.builder, rng, plot, float(rng.uniform(9.5, 12.0)), True)
    elif kind == "house":
        add_house(farm.builder, rng, plot, int(rng.integers(3, 5)), 0.0)
    else:
        add_tree_wall(farm.builder, rng, "conifer", farm.autumn, end_m, 16.0)
    return plot.shrunk(-3.0)


def _rows(farm: _Farm, land: Rect, apart_m: float) -> list[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Ends of parallel rows on a field, north to south or across."""
    across = farm.rng.random() < 0.5
    low, high = (land.north_low_m, land.north_high_m) if across else (land.east_low_m, land.east_high_m)
    rows = []
    for place in np.arange(low + 0.5, high, apart_m):
        if across:
            ends = ([place, land.east_low_m, 0.0], [place, land.east_high_m, 0.0])
        else:
            ends = ([land.north_low_m, place, 0.0], [land.north_high_m, place, 0.0])
        rows.append((np.array(ends[0]), np.array(ends[1])))
    return rows


def _vineyard(farm: _Farm, land: Rect) -> None:
    rng = farm.rng
    leaves, height, width = rng.random() < 0.5, rng.uniform(0.9, 1.7), rng.uniform(0.3, 0.6)
    for first, last in _rows(farm, land, float(rng.uniform(2.2, 4.0))):
        add_trellis(farm.builder, rng, first, last)
        if leaves:
            add_hedge(farm.builder, rng, first, last, height, width, "leaves")


def _hops(farm: _Farm, land: Rect) -> None:
    add_hop_garden(farm.builder, farm.rng, land)


def _cables(farm: _Farm, land: Rect) -> None:
    for first, last in _rows(farm, land, float(farm.rng.uniform(8.0, 20.0))):
        add_low_cables(farm.builder, farm.rng, first, last)


def _pasture(farm: _Farm, land: Rect) -> None:
    rng = farm.rng
    ring = np.array([(*corner, 0.0) for corner in land.corners])
    ring = np.concatenate([ring, ring[:1]])
    if rng.random() < 0.6:
        add_wire_fence(farm.builder, rng, ring)
    else:
        add_fence(farm.builder, rng, ring, FENCE_KINDS[int(rng.integers(len(FENCE_KINDS)))])
    farm.plant(_inside(rng, land.shrunk(3.0), int(rng.integers(0, 4))), 4.0, 11.0)


def _orchard(farm: _Farm, land: Rect) -> None:
    rng, apart = farm.rng, float(farm.rng.uniform(4.0, 7.0))
    height = float(rng.uniform(2.5, 5.0))
    for first, last in _rows(farm, land, apart):
        feet = np.linspace(first, last, max(2, round(_FIELD_M / apart)))
        farm.plant(feet[:, :2] + rng.normal(0.0, 0.2, (len(feet), 2)), 0.8 * height, height)
        add_posts(
            farm.builder, rng, feet + np.array([0.3, 0.3, 0.0]), 0.7 * height, float(rng.uniform(0.02, 0.05))
        )


def _tunnels(farm: _Farm, land: Rect) -> None:
    width = land.east_high_m - land.east_low_m
    for number in range(3):
        low = land.east_low_m + number * width / 3.0
        add_hoops(farm.builder, farm.rng, Rect(land.north_low_m, land.north_high_m, low, low + 0.3 * width))


def _masts(farm: _Farm, land: Rect) -> None:
    """Single poles and masts: lights, flags, aerials, nets' posts."""
    rng = farm.rng
    places = _inside(rng, land, int(rng.integers(3, 12)))
    feet = np.column_stack([places, np.zeros(len(places))])
    for foot in feet[:3]:
        add_mast(farm.builder, rng, float(foot[0]), float(foot[1]), 0.0)
    for foot in feet[3:]:
        height, radius = float(rng.uniform(1.5, 9.0)), float(rng.uniform(0.02, 0.12))
        add_posts(farm.builder, rng, foot[None], height, radius)


def _yard(farm: _Farm, land: Rect) -> None:
    rng = farm.rng
    add_hall(farm.builder, rng, land.shrunk(float(rng.uniform(4.0, 7.0))), float(rng.uniform(5.0, 8.0)))
    add_silo(farm.builder, rng, land.north_low_m + 2.0, land.east_low_m + 2.0, float(rng.uniform(1.0, 1.4)))


def _ploughed(farm: _Farm, land: Rect) -> None:
    rng = farm.rng
    for north, east in _inside(rng, land.shrunk(6.0), int(rng.integers(1, 4))):
        add_heap(farm.builder, rng, north, east)


def _inside(rng: np.random.Generator, land: Rect, count: int) -> NDArray[np.float64]:
    """(count, 2) random places on a field."""
    low, high = (land.north_low_m, land.east_low_m), (land.north_high_m, land.east_high_m)
    return rng.uniform(low, high, (count, 2))


def _add_borders(farm: _Farm) -> None:
    """An overhead line and trees around the fields."""
    rng = farm.rng
    aside = float(rng.choice([-1.0, 1.0])) * (0.5 * _FIELD_M + _FIELD_M * int(rng.integers(1, _FIELDS)))
    line = np.array([(north, aside, 0.0) for north in np.arange(-_REACH_M, _REACH_M, 26.0)])
    add_line(farm.builder, rng, line, "wood" if rng.random() < 0.7 else "concrete")
    turn = rng.uniform(0.0, 2 * np.pi, 60)
    places = rng.uniform(_REACH_M + 5.0, 1.5 * _REACH_M, 60)[:, None]
    farm.plant(places * np.column_stack([np.cos(turn), np.sin(turn)]), 6.0, 15.0)


def _add_movers(farm: _Farm) -> None:
    rng = farm.rng
    crowd, vehicles = Crowd(rng), Stamps(rng, [lorry, lorry, fork_lift], {"paint": PAINTS_BGR})
    for _ in range(int(rng.integers(4, 20))):
        place = rng.uniform(-_REACH_M + 10.0, _REACH_M - 10.0, 2)
        if farm.corridor.is_free_around(place, 3.5)[0]:
            course = float(rng.uniform(0.0, 2 * np.pi))
            if rng.random() < 0.75:
                crowd.put(place[0], place[1], 0.0, course)
            else:
                vehicles.put(place[0], place[1], 0.0, course)
    crowd.build(farm.builder)
    vehicles.build(farm.builder)
