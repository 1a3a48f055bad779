"""`suburb`: low houses in gardens with hedges, fences and carports under overhead wires; some in snow."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from uavdepth.scenes.buildings import add_house
from uavdepth.scenes.cars import CarPark
from uavdepth.scenes.city_life import CityPlan, add_overhead, add_pedestrians, add_traffic
from uavdepth.scenes.corridor import Corridor
from uavdepth.scenes.cottages import Lot, add_lot
from uavdepth.scenes.description import SceneDescription
from uavdepth.scenes.groves import plant, tree_template
from uavdepth.scenes.mesh import MeshBuilder
from uavdepth.scenes.plots import add_patches, patch_lines
from uavdepth.scenes.solids import Point, Rect, add_slab, add_wall
from uavdepth.scenes.street_furniture import add_lamp, add_small_thing
from uavdepth.scenes.street_grid import (
    KERB_M,
    PAVEMENT_M,
    REACH_M,
    Street,
    draw_blocks,
    ground_height,
    parallel_streets,
)
from uavdepth.scenes.undergrowth import add_bush
from uavdepth.scenes.vegetation import TreeKind
from uavdepth.scenes.weather import draw_weather

_HORIZON_M = 900.0
_LOT_M = (13.0, 19.0)
_KINDS: tuple[tuple[TreeKind, ...], ...] = (
    ("broadleaf", "birch", "conifer"),
    ("broadleaf", "broadleaf", "poplar"),
    ("bare", "bare", "conifer"),
)
_WINTER: tuple[TreeKind, ...] = ("bare", "bare", "snowy_conifer")


def build(seed: int) -> SceneDescription:
    """The suburb of one seed: its origin lies in a street that ends at a row of houses to the north."""
    rng = np.random.default_rng([seed, 0x5B0B])
    builder = MeshBuilder()
    snowy = bool(rng.random() < 0.25)
    facade_m = float(rng.uniform(33.0, 42.0))
    cross = Street(0.0, float(rng.uniform(0.6, 1.4)))
    spread = {"apart_m": (50.0, 72.0), "half_road_m": (0.4, 1.4)}
    easts = parallel_streets(rng, Street(0.0, float(rng.uniform(0.8, 1.6))), **spread)
    first = Street(facade_m - cross.half_width_m, cross.half_road_m)
    norths = parallel_streets(rng, first, **spread)
    blocks = draw_blocks(easts, norths, facade_m)
    plan = CityPlan(easts, norths, blocks, [], facade_m)
    corridor = Corridor(facade_m)
    _add_ground(builder, rng, snowy)
    cars = CarPark(rng)
    gardens: list[Point] = []
    for block in blocks:
        gardens += _add_block(builder, rng, plan, block, cars, snowy)
    _add_trees(builder, rng, corridor, gardens, snowy)
    _park_cars(rng, plan, corridor, cars)
    cars.build(builder)
    add_traffic(builder, rng, plan, gap_m=rng.uniform(25.0, 80.0), parked_m=-2.0)
    add_pedestrians(builder, rng, plan, apart_m=rng.uniform(40.0, 110.0))
    add_overhead(builder, rng, plan, lines=0.7)
    _add_street_things(builder, rng, plan)
    weather = draw_weather(rng, (0.0006, 0.007))
    return weather.over(builder.build(), ground_height(blocks), REACH_M - 20.0)


def _add_ground(builder: MeshBuilder, rng: np.random.Generator, snowy: bool) -> None:
    shade = rng.uniform(0.9, 1.15)

    def look(outermost: bool) -> tuple[str, ArrayLike]:
        texture = ("snow" if snowy else "grass") if outermost else "asphalt"
        return texture, np.full(3, shade * rng.uniform(0.9, 1.1) * (1.5 if snowy and not outermost else 1.0))

    add_patches(builder, patch_lines(REACH_M + 60.0, 15.0, _HORIZON_M), look)


def _add_block(
    builder: MeshBuilder,
    rng: np.random.Generator,
    plan: CityPlan,
    block: Rect,
    cars: CarPark,
    snowy: bool,
) -> list[Point]:
    """Pavement, lots in two rows back to back. Returns places for trees."""
    pavement = block.shrunk(-PAVEMENT_M)
    ring = pavement.corners
    for start, end in zip(ring, ring[1:] + ring[:1], strict=True):
        add_wall(builder, start, end, 0.0, KERB_M, "concrete")
    stone = str(rng.choice(["paving", "asphalt", "concrete"]))
    add_slab(builder, pavement, KERB_M, "snow" if snowy and rng.random() < 0.6 else stone)
    north_low = block.north_low_m
    if abs(north_low - plan.facade_m) < 0.1 and block.east_low_m < 20.0 and block.east_high_m > -20.0:
        low, high = max(block.east_low_m, -24.0), min(block.east_high_m, 24.0)
        add_house(builder, rng, Rect(north_low, north_low + 10.0, low, high), 3, KERB_M)
        north_low += 12.0
    middle = 0.5 * (north_low + block.north_high_m)
    places: list[Point] = []
    whole = Rect(north_low, block.north_high_m, block.east_low_m, block.east_high_m)
    if north_low > block.north_low_m:
        rows = [(whole, 1.0)]
    elif block.north_high_m - north_low < 34.0:
        rows = [(whole, float(rng.choice([-1.0, 1.0])))]
    else:
        rows = [
            (replace(whole, north_low_m=middle), 1.0),
            (replace(whole, north_high_m=middle), -1.0),
        ]
    for row, street in rows:
        count = max(1, round((row.east_high_m - row.east_low_m) / rng.uniform(*_LOT_M)))
        cuts = np.linspace(row.east_low_m, row.east_high_m, count + 1)
        for west, east in pairwise(cuts):
            land = Rect(row.north_low_m, row.north_high_m, float(west), float(east))
            if max(abs(land.east_low_m), abs(land.east_high_m)) > REACH_M + 15.0:
                continue
            places += add_lot(builder, rng, Lot(land, street, KERB_M, snowy), cars)
    return places


def _add_trees(
    builder: MeshBuilder, rng: np.random.Generator, corridor: Corridor, gardens: list[Point], snowy: bool
) -> None:
    kinds = _WINTER if snowy else _KINDS[int(rng.integers(len(_KINDS)))]
    autumn = float(rng.choice([0.0, 0.1, 0.8]))
    templates = [
        tree_template(rng, kinds[number % 3], float(rng.uniform(5.0, 9.0)), autumn) for number in range(5)
    ]
    places = np.array(gardens, float).reshape(-1, 2)
    heights = rng.uniform(3.5, 9.5, len(places))
    reach = max(template.reach for template in templates) * heights
    free = corridor.is_free_around(places, reach)
    feet = np.column_stack([places, np.full(len(places), -KERB_M)])[free]
    plant(builder, rng, templates, feet, heights[free])
    if not snowy:
        for north, east, down in feet[::3]:
            spot = (north + rng.uniform(-2.0, 2.0), east + rng.uniform(-2.0, 2.0))
            if corridor.is_free_around(spot, 2.0)[0]:
                add_bush(builder, rng, *spot, down, rng.uniform(0.6, 1.6), autumn)


def _park_cars(rng: np.random.Generator, plan: CityPlan, corridor: Corridor, cars: CarPark) -> None:
    """Cars at the kerbs."""
    for axis, street, others in plan.streets():
        for along in np.arange(-REACH_M + 20.0, REACH_M - 20.0, 8.0):
            near = min(abs(along - other.middle_m) - other.half_width_m for other in others)
            side = float(rng.choice([-1.0, 1.0]))
            if near < 2.0 or rng.random() > 0.25 or plan.is_built_over(axis, street, float(along)):
                continue
            across = street.middle_m + side * (street.half_width_m - 1.1)
            spot = (float(along), across) if axis == 1 else (across, float(along))
            if corridor.is_free_around(spot, 1.2)[0]:
                heading = 0.0 if axis == 1 else 0.5 * np.pi
                cars.park(*spot, 0.0, heading + (np.pi if rng.random() < 0.5 else 0.0))


def _add_street_things(builder: MeshBuilder, rng: np.random.Generator, plan: CityPlan) -> None:
    """Lamps, bins and cabinets on the pavements."""
    for axis, street, others in plan.streets():
        for along in np.arange(-REACH_M + 25.0, REACH_M - 25.0, 24.0) + rng.uniform(0.0, 10.0):
            side = float(rng.choice([-1.0, 1.0]))
            across = street.middle_m + side * (street.half_width_m + 0.6)
            spot = (float(along), across) if axis == 1 else (across, float(along))
            near = min(abs(along - other.middle_m) - other.half_width_m for other in others)
            if near < 0.0 or not plan.keeps_free((spot[0] - 1, spot[1] - 1), (spot[0] + 1, spot[1] + 1)):
                continue
            if plan.is_built_over(axis, street, float(along)):
                continue
            if rng.random() < 0.6:
                add_lamp(builder, rng, *spot, KERB_M, (0.0, -side) if axis == 1 else (-side, 0.0))
            else:
                add_small_thing(builder, rng, *spot, KERB_M)
