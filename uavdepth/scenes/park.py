"""`park`: lawns and paths with trees, hedges, a pond, railings, lamps, people, a footbridge, a kiosk."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from uavdepth.scenes.bridges import add_bridge
from uavdepth.scenes.buildings import add_gable, add_house
from uavdepth.scenes.copies import Template, add_copies
from uavdepth.scenes.corridor import Corridor
from uavdepth.scenes.description import SceneDescription
from uavdepth.scenes.fences import FENCE_KINDS, add_fence
from uavdepth.scenes.groves import add_tree_wall, plant, tree_template
from uavdepth.scenes.hedges import add_hedge
from uavdepth.scenes.lawns import CORE_M, Lawns, Path
from uavdepth.scenes.mesh import MeshBuilder
from uavdepth.scenes.overhead import add_mast
from uavdepth.scenes.people import Crowd
from uavdepth.scenes.shelters import add_covered_walk, add_stall
from uavdepth.scenes.solids import Rect, add_box
from uavdepth.scenes.street_furniture import add_lamp, add_small_thing
from uavdepth.scenes.terrain import LandNoise
from uavdepth.scenes.traffic import KINDS, Traffic
from uavdepth.scenes.undergrowth import add_bush
from uavdepth.scenes.vegetation import TreeKind, add_far_tree
from uavdepth.scenes.weather import draw_weather

_EXTENT_M = 80.0
_TREES = 420
_FAR_M = 170.0
_CYCLIST = KINDS[-1]

_SUMMER: tuple[dict[TreeKind, float], ...] = (
    {"broadleaf": 0.7, "birch": 0.15, "conifer": 0.1, "bare": 0.05},
    {"broadleaf": 0.4, "poplar": 0.3, "conifer": 0.2, "birch": 0.1},
    {"conifer": 0.35, "broadleaf": 0.4, "bare": 0.25},
    {"bare": 0.7, "conifer": 0.2, "birch": 0.1},
)
_WINTER: dict[TreeKind, float] = {"bare": 0.65, "snowy_conifer": 0.3, "dead": 0.05}


@dataclass(frozen=True)
class _Park:
    rng: np.random.Generator
    builder: MeshBuilder
    lawns: Lawns
    corridor: Corridor
    kinds: dict[TreeKind, float]
    autumn: float
    snowy: bool

    def free(self, places: NDArray[np.float64], reach_m: ArrayLike) -> NDArray[np.bool_]:
        """(K,) whether things of that reach keep the corridor free and stand within the park."""
        inside = np.abs(places).max(axis=1) < CORE_M - 2.0
        return np.asarray(inside & self.corridor.is_free_around(places, reach_m))


def build(seed: int) -> SceneDescription:
    """The park of one seed: a house or a dense stand of trees ends the view to the north."""
    rng = np.random.default_rng([seed, 0x9A2C])
    builder = MeshBuilder()
    end_m = float(rng.uniform(33.0, 40.0))
    snowy = rng.random() < 0.2
    autumn = float(rng.choice([0.0, 0.0, 0.2, 0.8]))
    kinds = _WINTER if snowy else _SUMMER[int(rng.integers(len(_SUMMER)))]
    lawns = Lawns(rng, end_m)
    corridor = Corridor(end_m, front_half_m=16.0, front_depth_m=6.0)
    park = _Park(rng, builder, lawns, corridor, kinds, autumn, snowy)
    paving = str(rng.choice(["gravel", "asphalt", "paving", "soil", "cobbles"]))
    lawns.add(builder, rng, "snow" if snowy else "grass", paving)
    if rng.random() < 0.5:
        kind: TreeKind = "snowy_conifer" if snowy else "conifer"
        add_tree_wall(builder, rng, kind, autumn, end_m, 16.0)
    else:
        add_house(builder, rng, Rect(end_m, end_m + 13.0, -18.0, 18.0), int(rng.integers(3, 6)), 0.0)
    _add_trees(park)
    _add_along_paths(park)
    _add_hedges(park)
    _add_people(park)
    _add_places(park)
    _add_far_trees(park)
    weather = draw_weather(rng, (0.0006, 0.007))
    return weather.over(builder.build(), lawns.height_m, _EXTENT_M)


def _add_trees(park: _Park) -> None:
    """Groves and single trees, off the paths."""
    rng = park.rng
    places = rng.uniform(-CORE_M, CORE_M, (3 * _TREES, 2))
    groves = LandNoise(rng, 26.0).at(places[:, 0], places[:, 1]) + rng.normal(0.0, 0.3, len(places))
    places = places[groves > rng.uniform(0.0, 0.35)]
    places = places[park.free(places, 1.0) & park.lawns.is_lawn(places, 0.9)][:_TREES]
    kinds = list(park.kinds)
    species = rng.choice(len(kinds), size=len(places), p=list(park.kinds.values()))
    for number, kind in enumerate(kinds):
        templates = [tree_template(rng, kind, float(rng.uniform(7.0, 12.0)), park.autumn) for _ in range(3)]
        heights = rng.uniform(4.5, 14.0, len(places))
        reach = max(template.reach for template in templates) * heights
        here = (species == number) & park.corridor.is_free_around(places, reach)
        plant(park.builder, rng, templates, park.lawns.feet(places[here]), heights[here])
    if not park.snowy:
        places = rng.uniform(-CORE_M, CORE_M, (60, 2))
        places = places[park.free(places, 2.0) & park.lawns.is_lawn(places, 1.5)]
        for north, east, down in park.lawns.feet(places):
            add_bush(park.builder, rng, north, east, down, rng.uniform(0.6, 2.0), park.autumn)


def _beside(path: Path, number: int, aside_m: float) -> tuple[NDArray[np.float64], float]:
    """A place beside a path's point, and the heading of the path there, radians."""
    step = path.points_m[number + 1] - path.points_m[number]
    heading = float(np.arctan2(step[1], step[0]))
    right = np.array([-np.sin(heading), np.cos(heading)])
    return path.points_m[number] + (path.half_width_m + abs(aside_m)) * np.sign(aside_m) * right, heading


def _add_along_paths(park: _Park) -> None:
    """Lamps, benches and railings beside the paths; a railing around a part of the pond."""
    rng, builder, lawns = park.rng, park.builder, park.lawns
    for path in lawns.paths:
        last = len(path.points_m) - 1
        for number in range(2, last, 10):
            place, heading = _beside(path, number, rng.choice([-0.8, 0.8]))
            if not park.free(place[None], 1.5)[0]:
                continue
            north, east, down = lawns.feet(place)[0]
            if rng.random() < 0.5:
                add_lamp(builder, rng, north, east, -down, (-np.sin(heading), np.cos(heading)))
            else:
                add_small_thing(builder, rng, north, east, -down)
        if rng.random() < 0.6:
            start = int(rng.integers(0, max(1, last - 16)))
            side = float(rng.choice([-0.35, 0.35]))
            spots = np.array(
                [_beside(path, number, side)[0] for number in range(start, min(start + 14, last))]
            )
            if park.free(spots, 1.0).all():
                kind = FENCE_KINDS[int(rng.integers(3))]
                add_fence(builder, rng, lawns.feet(spots), kind)
    shore = lawns.feet(lawns.pond.shore(1.2, 49))[: int(rng.integers(10, 49))]
    add_fence(builder, rng, shore, "railing" if rng.random() < 0.5 else "pickets")


def _add_hedges(park: _Park) -> None:
    rng = park.rng
    for _ in range(int(rng.integers(4, 14))):
        start = rng.uniform(-75.0, 75.0, 2)
        turn = rng.integers(4) * 0.5 * np.pi + rng.normal(0.0, 0.2)
        end = start + rng.uniform(6.0, 22.0) * np.array([np.cos(turn), np.sin(turn)])
        line = np.linspace(start, end, 8)
        if park.free(line, 2.0).all() and park.lawns.is_lawn(line, 1.0).all():
            height, width = rng.uniform(0.7, 2.3), rng.uniform(0.6, 1.3)
            pieces = park.lawns.feet(line[[0, 3, 7]])
            texture = "snowy_needles" if park.snowy else "leaves"
            for first, last in ((0, 1), (1, 2)):
                add_hedge(park.builder, rng, pieces[first], pieces[last], height, width, texture)


def _add_people(park: _Park) -> None:
    """Walkers and cyclists on the paths, groups on the lawns."""
    rng, lawns = park.rng, park.lawns
    crowd, traffic = Crowd(rng), Traffic(rng)
    for path in lawns.paths:
        for _ in range(int(rng.integers(2, 9))):
            number = int(rng.integers(0, len(path.points_m) - 1))
            aside = rng.uniform(-0.6, 0.6) * path.half_width_m
            place, heading = _beside(path, number, -0.01)
            place = place + (path.half_width_m + aside) * np.array([-np.sin(heading), np.cos(heading)])
            if not park.free(place[None], 1.2)[0]:
                continue
            north, east, down = lawns.feet(place)[0]
            course = heading + rng.choice([0.0, np.pi]) + rng.normal(0.0, 0.15)
            if rng.random() < 0.2:
                traffic.put(_CYCLIST, north, east, -down, course)
            else:
                crowd.put(north, east, -down, course)
    for _ in range(int(rng.integers(2, 8))):
        middle = rng.uniform(-60.0, 60.0, 2)
        spots = middle + rng.normal(0.0, 1.2, (int(rng.integers(1, 5)), 2))
        if park.free(spots, 1.5).all() and lawns.is_lawn(spots, 0.5).all():
            for north, east, down in lawns.feet(spots):
                crowd.put(north, east, -down, rng.uniform(0, 2 * np.pi))
    crowd.build(park.builder)
    traffic.build(park.builder)


def _add_places(park: _Park) -> None:
    """A footbridge over the pond, a kiosk, pergolas, stalls, flagpoles."""
    rng, builder, lawns = park.rng, park.builder, park.lawns
    pond = lawns.pond
    reach = pond.half_east_m * 1.35
    ends = ((pond.north_m, pond.east_m - reach), (pond.north_m, pond.east_m + reach))
    ground = float(np.mean(lawns.height_m(pond.north_m, [ends[0][1], ends[1][1]])))
    add_bridge(builder, rng, *ends, ground, rng.uniform(2.6, 4.2), rng.uniform(1.8, 3.0), span_m=14.0)
    for _ in range(int(rng.integers(3, 9))):
        place = rng.uniform(-65.0, 65.0, 2)
        if not (park.free(place[None], 7.0)[0] and lawns.is_lawn(place, 4.0)[0]):
            continue
        north, east, down = (float(v) for v in lawns.feet(place)[0])
        kind = rng.choice(["kiosk", "pergola", "stall", "mast", "court"])
        if kind == "kiosk":
            _add_kiosk(builder, rng, north, east, -down)
        elif kind == "pergola":
            half = rng.uniform(3.0, 6.0)
            add_covered_walk(builder, rng, (north - half, east), (north + half, east), -down, 3.0)
        elif kind == "stall":
            add_stall(builder, rng, north, east, -down, rng.uniform(0, np.pi))
        elif kind == "mast":
            add_mast(builder, rng, north, east, -down)
        else:
            ring = np.array([(-6.0, -4.0), (-6.0, 4.0), (6.0, 4.0), (6.0, -4.0), (-6.0, -4.0)]) + place
            add_fence(builder, rng, lawns.feet(ring), "chain" if rng.random() < 0.5 else "mesh", 2.6)


def _add_kiosk(
    builder: MeshBuilder, rng: np.random.Generator, north_m: float, east_m: float, ground_m: float
) -> None:
    plot = Rect(north_m - 1.6, north_m + 1.6, east_m - 2.2, east_m + 2.2)
    size, top = (3.2, 4.4), ground_m + rng.uniform(2.5, 3.0)
    wall = str(rng.choice(["planks", "plaster", "board", "paint"]))
    tint = rng.uniform(0.6, 1.1, 3)
    add_box(builder, (north_m, east_m), size, ground_m - 0.6, top, wall, tint)
    add_box(builder, (north_m - 1.6, east_m), (0.08, 2.6), ground_m + 1.0, top - 0.4, "car_glass")
    add_gable(builder, rng, plot, top, wall, tint, eaves_m=0.5)


def _add_far_trees(park: _Park) -> None:
    """A belt of trees around the park."""
    rng = park.rng
    places = rng.uniform(-_FAR_M, _FAR_M, (900, 2))
    places = places[np.abs(places).max(axis=1) > CORE_M + 2.0]
    feet = park.lawns.feet(places)
    which = rng.integers(4, size=len(feet))
    kinds = list(park.kinds)
    for number in range(4):
        kind = kinds[int(rng.choice(len(kinds), p=list(park.kinds.values())))]
        template = Template.of(partial(add_far_tree, rng=rng, height_m=12.0, kind=kind), 12.0)
        here = which == number
        add_copies(park.builder, rng, template, feet[here], rng.uniform(8.0, 17.0, int(here.sum())))
