"""`city`: streets between blocks of houses, with trees, lamps, signs, parked cars, traffic and people."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from uavdepth.scenes.buildings import add_house
from uavdepth.scenes.cars import CarPark
from uavdepth.scenes.city_life import CityPlan, House, add_city_life
from uavdepth.scenes.copies import Template, add_copies
from uavdepth.scenes.description import SceneDescription
from uavdepth.scenes.mesh import MeshBuilder
from uavdepth.scenes.plots import add_patches, patch_lines
from uavdepth.scenes.solids import Rect, add_slab, add_wall
from uavdepth.scenes.street_furniture import add_lamp, add_sign, add_small_thing
from uavdepth.scenes.street_grid import (
    KERB_M,
    PAVEMENT_M,
    REACH_M,
    Street,
    draw_blocks,
    draw_street,
    ground_height,
    off_corridor,
    parallel_streets,
)
from uavdepth.scenes.textures_facade import FACADE_CELL_M
from uavdepth.scenes.undergrowth import add_bush
from uavdepth.scenes.vegetation import TreeKind, add_tree
from uavdepth.scenes.weather import draw_weather

_HORIZON_M = 900.0

_TREES: tuple[tuple[TreeKind, ...], ...] = (
    ("broadleaf", "birch"),
    ("broadleaf",),
    ("poplar", "broadleaf"),
    ("conifer", "broadleaf"),
    ("bare", "conifer"),
)


@dataclass(frozen=True)
class _Town:
    rng: np.random.Generator
    builder: MeshBuilder
    cars: CarPark
    trees: list[Template]
    greenery: float
    """Chance that a place for a tree has one."""
    parked: float
    """Chance that a place for a car has one."""
    floors: tuple[int, int]
    facade_north_m: float
    houses: list[House] = field(default_factory=list)


def build(seed: int) -> SceneDescription:
    """The city of one seed: its origin lies in a street that ends at a facade to the north."""
    rng = np.random.default_rng([seed, 0xC17])
    builder = MeshBuilder()
    facade_m = float(rng.uniform(33.0, 43.0))
    cross = draw_street(rng)
    easts = parallel_streets(rng, Street(0.0, rng.uniform(5.0, 6.0)))
    norths = parallel_streets(rng, Street(facade_m - cross.half_width_m, cross.half_road_m))
    low = int(rng.integers(2, 6))
    kinds = _TREES[int(rng.integers(len(_TREES)))]
    autumn = float(rng.choice([0.0, 0.0, 0.3, 0.9]))
    templates = [_tree_template(rng, kinds[int(rng.integers(len(kinds)))], autumn) for _ in range(4)]
    floors = (low, low + int(rng.integers(1, 6)))
    town = _Town(
        rng,
        builder,
        CarPark(rng),
        templates,
        greenery=rng.uniform(0.15, 0.9),
        parked=rng.uniform(0.15, 0.85),
        floors=floors,
        facade_north_m=facade_m,
    )
    _add_ground(town)
    blocks = draw_blocks(easts, norths, facade_m)
    for block in blocks:
        _add_block(town, block)
    _add_roads(town, easts, norths, facade_m)
    town.cars.build(builder)
    add_city_life(builder, seed, CityPlan(easts, norths, blocks, town.houses, facade_m))
    weather = draw_weather(rng, (0.0006, 0.008))
    return weather.over(builder.build(), ground_height(blocks), REACH_M - 15.0)


def _add_ground(town: _Town) -> None:
    """Asphalt in slabs of changing shade, so that the plane is not one tone."""
    lines, shade = patch_lines(REACH_M + 60.0, 14.0, _HORIZON_M), town.rng.uniform(0.85, 1.1)
    add_patches(town.builder, lines, lambda _: ("asphalt", np.full(3, shade * town.rng.uniform(0.9, 1.1))))


def _tree_template(rng: np.random.Generator, kind: TreeKind, autumn: float) -> Template:
    height = float(rng.uniform(5.0, 9.0))
    return Template.of(
        lambda builder: add_tree(builder, rng, 0.0, 0.0, 0.0, height, kind, None, autumn), height
    )


def _add_block(town: _Town, block: Rect) -> None:
    """Pavement, houses along the edges, a yard inside."""
    rng, builder = town.rng, town.builder
    pavement = block.shrunk(-PAVEMENT_M)
    stone = str(rng.choice(["paving", "paving", "cobbles", "concrete"]))
    tint = np.full(3, rng.uniform(0.8, 1.08))
    ring = pavement.corners
    for start, end in zip(ring, ring[1:] + ring[:1], strict=True):
        add_wall(builder, start, end, 0.0, KERB_M, "concrete", (1.0, 1.0, 1.0))
    for strip in _frame(pavement, block):
        add_slab(builder, strip, KERB_M, stone, tint)
    add_slab(builder, block, KERB_M, str(rng.choice(["grass", "gravel", "concrete"])), tint)
    for plot in _plots(rng, block):
        front = abs(plot.north_low_m - town.facade_north_m) < 0.1
        faces_origin = front and plot.east_low_m < 11.0 and plot.east_high_m > -11.0
        if rng.random() < 0.1 and not faces_origin:
            _add_garden(town, plot)
            continue
        floors = int(rng.integers(town.floors[0], town.floors[1] + 1))
        floors = max(floors, 4) if faces_origin else floors
        add_house(builder, rng, plot, floors, KERB_M)
        town.houses.append(House(plot, block, floors))
    _furnish(town, pavement)


def _frame(outer: Rect, inner: Rect) -> list[Rect]:
    """The four strips between two rectangles."""
    return [
        Rect(outer.north_low_m, inner.north_low_m, outer.east_low_m, outer.east_high_m),
        Rect(inner.north_high_m, outer.north_high_m, outer.east_low_m, outer.east_high_m),
        Rect(inner.north_low_m, inner.north_high_m, outer.east_low_m, inner.east_low_m),
        Rect(inner.north_low_m, inner.north_high_m, inner.east_high_m, outer.east_high_m),
    ]


def _plots(rng: np.random.Generator, block: Rect) -> list[Rect]:
    """House plots along the block's edges, their fronts a whole number of window cells wide."""
    deep = min(rng.uniform(9.0, 13.0), 0.45 * (block.north_high_m - block.north_low_m))
    plots = []
    for low, high in (
        (block.north_low_m, block.north_low_m + deep),
        (block.north_high_m - deep, block.north_high_m),
    ):
        plots += [Rect(low, high, a, b) for a, b in _lots(rng, block.east_low_m, block.east_high_m)]
    inner_low, inner_high = block.north_low_m + deep, block.north_high_m - deep
    if inner_high - inner_low > 9.0:
        for low, high in (
            (block.east_low_m, block.east_low_m + deep),
            (block.east_high_m - deep, block.east_high_m),
        ):
            plots += [Rect(a, b, low, high) for a, b in _lots(rng, inner_low, inner_high)]
    return plots


def _lots(rng: np.random.Generator, low_m: float, high_m: float) -> list[tuple[float, float]]:
    lots = []
    place = low_m
    while high_m - place >= 2 * FACADE_CELL_M:
        width = FACADE_CELL_M * int(rng.integers(3, 8))
        if high_m - place - width < 2 * FACADE_CELL_M:
            width = high_m - place
        lots.append((place, place + width))
        place += width
    return lots


def _add_garden(town: _Town, plot: Rect) -> None:
    """A gap between houses: grass, bushes and a few trees."""
    rng = town.rng
    add_slab(town.builder, plot, KERB_M + 0.02, "grass")
    for _ in range(3):
        place = _inside(rng, plot)
        add_copies(
            town.builder, rng, town.trees[int(rng.integers(4))], _feet([place]), rng.uniform(4.0, 9.0, 1)
        )
        add_bush(town.builder, rng, *_inside(rng, plot), -KERB_M, rng.uniform(0.8, 2.0))


def _inside(rng: np.random.Generator, plot: Rect) -> tuple[float, float]:
    return (
        float(rng.uniform(plot.north_low_m + 1, plot.north_high_m - 1)),
        float(rng.uniform(plot.east_low_m + 1, plot.east_high_m - 1)),
    )


def _feet(places: list[tuple[float, float]]) -> NDArray[np.float64]:
    return np.array([(north, east, -KERB_M) for north, east in places], float).reshape(-1, 3)


def _furnish(town: _Town, pavement: Rect) -> None:
    """Trees, lamps, signs and small things along the kerb."""
    rng = town.rng
    planted: list[tuple[float, float]] = []
    edges = (
        (0, pavement.north_low_m + 0.9, pavement.east_low_m, pavement.east_high_m, (-1.0, 0.0)),
        (0, pavement.north_high_m - 0.9, pavement.east_low_m, pavement.east_high_m, (1.0, 0.0)),
        (1, pavement.east_low_m + 0.9, pavement.north_low_m, pavement.north_high_m, (0.0, -1.0)),
        (1, pavement.east_high_m - 0.9, pavement.north_low_m, pavement.north_high_m, (0.0, 1.0)),
    )
    for axis, line_m, low_m, high_m, outwards in edges:
        for number, along_m in enumerate(np.arange(low_m + 3.0, high_m - 2.0, 5.5)):
            place = (line_m, float(along_m)) if axis == 0 else (float(along_m), line_m)
            if abs(place[0]) > REACH_M or abs(place[1]) > REACH_M or not off_corridor(*place, 1.2):
                continue
            if number % 4 == 0:
                add_lamp(town.builder, rng, *place, KERB_M, outwards)
            elif rng.random() < town.greenery:
                planted.append(place)
            elif rng.random() < 0.35:
                facing = float(np.arctan2(outwards[1], outwards[0])) + (
                    np.pi / 2 if rng.random() < 0.7 else 0.0
                )
                add_sign(town.builder, rng, *place, KERB_M, facing)
            elif rng.random() < 0.5:
                add_small_thing(town.builder, rng, *place, KERB_M)
    feet = _feet(planted)
    which = rng.integers(len(town.trees), size=len(feet))
    heights = rng.uniform(4.0, 8.5, len(feet))
    for number, template in enumerate(town.trees):
        here = which == number
        reach = template.reach * heights
        here &= np.array(
            [off_corridor(foot[0], foot[1], r) for foot, r in zip(feet, reach, strict=True)], bool
        )
        add_copies(town.builder, rng, template, feet[here], heights[here])


def _add_roads(town: _Town, easts: list[Street], norths: list[Street], facade_m: float) -> None:
    """Lane markings and parked cars."""
    for axis, streets, others in ((1, easts, norths), (0, norths, easts)):
        for street in streets:
            for along_m in np.arange(-REACH_M, REACH_M, 6.0):
                if (
                    axis == 1
                    and street.middle_m == 0.0
                    and along_m > facade_m - 16.0
                    and along_m < facade_m + 70.0
                ):
                    continue
                near = min(abs(along_m - other.middle_m) - other.half_width_m for other in others)
                if near < 2.0:
                    continue
                _mark_and_park(town, axis, street, float(along_m))


def _mark_and_park(town: _Town, axis: int, street: Street, along_m: float) -> None:
    rng = town.rng

    def place(side_m: float, ahead_m: float = 0.0) -> tuple[float, float]:
        across, along = street.middle_m + side_m, along_m + ahead_m
        return (along, across) if axis == 1 else (across, along)

    low, high = place(-0.07, -1.5), place(0.07, 1.5)
    add_slab(town.builder, Rect(low[0], high[0], low[1], high[1]), 0.006, "marking")
    for side in (-1.0, 1.0):
        if rng.random() > town.parked:
            continue
        spot = place(side * (street.half_road_m - 1.05), rng.uniform(-0.5, 0.5))
        if not off_corridor(*spot, 1.0) or (abs(spot[1]) < 9.0 and abs(spot[0] - town.facade_north_m) < 14.0):
            continue
        heading = (0.0 if axis == 1 else np.pi / 2) + (np.pi if rng.random() < 0.5 else 0.0)
        town.cars.park(*spot, 0.0, heading + rng.normal(0.0, 0.02))
