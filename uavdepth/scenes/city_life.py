"""What makes a city busy: traffic, people, wires, railings, scaffolding, awnings, bridges, cranes.

It draws from a random stream of its own: the streets and houses of a seed do not depend on it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uavdepth.scenes.bars import add_bars, add_wires
from uavdepth.scenes.bridges import add_bridge
from uavdepth.scenes.corridor import Corridor
from uavdepth.scenes.cranes import add_tower_crane
from uavdepth.scenes.fences import FenceKind, add_fence
from uavdepth.scenes.mesh import MeshBuilder
from uavdepth.scenes.overhead import add_line
from uavdepth.scenes.people import Crowd
from uavdepth.scenes.scaffolding import add_scaffold
from uavdepth.scenes.shelters import add_awning, add_bus_shelter, add_covered_walk, add_stall
from uavdepth.scenes.solids import Point, Rect, add_box
from uavdepth.scenes.street_grid import KERB_M, PAVEMENT_M, REACH_M, Street
from uavdepth.scenes.textures_facade import FACADE_CELL_M
from uavdepth.scenes.traffic import Traffic

_LIVELY_M = REACH_M - 12.0
"""How far from the origin anything is added."""


@dataclass(frozen=True)
class House:
    """A house: its plot, the block it stands in, its storeys."""

    plot: Rect
    block: Rect
    floors: int

    @property
    def fronts(self) -> list[tuple[Point, Point, Point]]:
        """Start and end of each side on a street, and the direction away from the house."""
        a, b, c, d = self.plot.corners  # south-west, south-east, north-east, north-west
        plot, block = self.plot, self.block
        sides = (
            (plot.north_low_m - block.north_low_m, a, b, (-1.0, 0.0)),
            (plot.east_high_m - block.east_high_m, b, c, (0.0, 1.0)),
            (plot.north_high_m - block.north_high_m, c, d, (1.0, 0.0)),
            (plot.east_low_m - block.east_low_m, d, a, (0.0, -1.0)),
        )
        return [(start, end, outwards) for gap, start, end, outwards in sides if abs(gap) < 0.1]


@dataclass(frozen=True)
class CityPlan:
    """Where streets, blocks and houses lie.

    Args:
        easts: streets that run north, by their easts.
        norths: streets that run east, by their norths.
        blocks: plots between them.
        houses: on the blocks.
        facade_m: north of the front that ends the street of the origin.
    """

    easts: list[Street]
    norths: list[Street]
    blocks: list[Rect]
    houses: list[House]
    facade_m: float

    def keeps_free(self, low: Point, high: Point) -> bool:
        """Whether the rectangle between two points lies in reach, off the corridor and off its end."""
        reaches = max(abs(v) for v in (*low, *high)) < _LIVELY_M
        return reaches and Corridor(self.facade_m).is_free(low, high)

    def streets(self) -> list[tuple[int, Street, list[Street]]]:
        """Axis (1 runs north, 0 runs east), street, and the streets that cross it."""
        return [(1, street, self.norths) for street in self.easts] + [
            (0, street, self.easts) for street in self.norths
        ]

    def is_built_over(self, axis: int, street: Street, along_m: float) -> bool:
        """Whether the street of the origin has ended there at its front."""
        return axis == 1 and street.middle_m == 0.0 and self.facade_m - 16.0 < along_m < self.facade_m + 70.0


def add_city_life(builder: MeshBuilder, seed: int, plan: CityPlan) -> None:
    """Fill the streets of one seed."""
    rng = np.random.default_rng([seed, 0x11FE])
    add_traffic(builder, rng, plan, gap_m=rng.uniform(14.0, 60.0))
    add_pedestrians(builder, rng, plan, apart_m=rng.uniform(18.0, 70.0))
    _add_kerb_things(builder, rng, plan)
    add_overhead(builder, rng, plan, lines=0.3)
    _add_house_things(builder, rng, plan)
    _add_bridges(builder, rng, plan)
    if rng.random() < 0.4:
        block = plan.blocks[int(rng.integers(len(plan.blocks)))]
        north = 0.5 * (block.north_low_m + block.north_high_m)
        east = 0.5 * (block.east_low_m + block.east_high_m)
        if np.hypot(north, east) > 50.0:
            add_tower_crane(builder, rng, north, east, KERB_M)


def _place(axis: int, along_m: float, across_m: float) -> Point:
    return (along_m, across_m) if axis == 1 else (across_m, along_m)


def _off_crossings(along_m: float, others: list[Street], margin_m: float) -> bool:
    return min(abs(along_m - other.middle_m) - other.half_width_m for other in others) > margin_m


def add_traffic(
    builder: MeshBuilder, rng: np.random.Generator, plan: CityPlan, gap_m: float, parked_m: float = 2.0
) -> None:
    """Put vehicles on all lanes, `gap_m` apart on average and off the `parked_m` along the kerbs.

    They keep to the right.
    """
    traffic = Traffic(rng)
    for axis, street, others in plan.streets():
        half_lane = 0.5 * (street.half_road_m - parked_m)
        for way in (1.0, -1.0):
            # Seen along its way, a lane that leads north lies east of the middle, one that leads east south.
            across = street.middle_m + way * half_lane * (1.0 if axis == 1 else -1.0)
            heading = (0.0 if axis == 1 else 0.5 * np.pi) + (0.0 if way > 0 else np.pi)
            along = -_LIVELY_M + rng.uniform(0.0, gap_m)
            while along < _LIVELY_M:
                kind = traffic.draw(half_lane + 0.1)
                half = (kind.half_length_m, kind.half_width_m)
                low = _place(axis, along - half[0], across - half[1])
                high = _place(axis, along + half[0], across + half[1])
                clear = _off_crossings(along, others, half[0]) and plan.keeps_free(low, high)
                if clear and not plan.is_built_over(axis, street, along):
                    place = _place(axis, along, across + rng.normal(0.0, 0.1))
                    traffic.put(kind, *place, 0.0, heading + rng.normal(0.0, 0.02))
                along += 2 * half[0] + 1.5 + rng.exponential(gap_m)
    traffic.build(builder)


def _edges(plan: CityPlan) -> list[tuple[int, float, float, float, float]]:
    """Kerbs: axis that they run along, line, low and high end, and which way the houses lie."""
    edges = []
    for block in plan.blocks:
        low_n, high_n = block.north_low_m - PAVEMENT_M, block.north_high_m + PAVEMENT_M
        low_e, high_e = block.east_low_m - PAVEMENT_M, block.east_high_m + PAVEMENT_M
        edges += [(0, low_n, low_e, high_e, 1.0), (0, high_n, low_e, high_e, -1.0)]
        edges += [(1, low_e, low_n, high_n, 1.0), (1, high_e, low_n, high_n, -1.0)]
    return edges


def add_pedestrians(builder: MeshBuilder, rng: np.random.Generator, plan: CityPlan, apart_m: float) -> None:
    """Put people on the pavements, about one on every `apart_m` of kerb."""
    crowd = Crowd(rng)
    for axis, line, low, high, inwards in _edges(plan):
        for _ in range(rng.poisson((high - low) / apart_m)):
            along, depth = rng.uniform(low, high), rng.uniform(1.3, 2.9)
            spot = _place(axis, along, line + inwards * depth)
            if not plan.keeps_free((spot[0] - 0.5, spot[1] - 0.5), (spot[0] + 0.5, spot[1] + 0.5)):
                continue
            heading = (0.0 if axis == 1 else 0.5 * np.pi) + rng.choice([0.0, np.pi, 0.5 * np.pi])
            crowd.put(*spot, KERB_M, heading + rng.normal(0.0, 0.25))
            if rng.random() < 0.25:
                beside = _place(axis, along + rng.uniform(-0.3, 0.3), line + inwards * (depth + 0.65))
                crowd.put(*beside, KERB_M, heading + rng.normal(0.0, 0.2))
    crowd.build(builder)


def _add_kerb_things(builder: MeshBuilder, rng: np.random.Generator, plan: CityPlan) -> None:
    """Railings along kerbs, stalls and bus shelters on pavements."""
    railed, stalls = rng.uniform(0.05, 0.3), rng.uniform(0.0, 0.12)
    for axis, line, low, high, inwards in _edges(plan):
        outwards = float(np.arctan2(*_place(axis, 0.0, -inwards)[::-1]))
        luck = rng.random()
        if luck < railed:
            start = rng.uniform(low + 0.4, max(high - 16.0, low + 0.5))
            ends = [_place(axis, at, line + 0.25 * inwards) for at in (start, min(start + 16.0, high - 0.4))]
            if plan.keeps_free(*ends):
                kind: FenceKind = "railing" if rng.random() < 0.7 else "handrail"
                add_fence(builder, rng, [(*end, -KERB_M) for end in ends], kind)
        elif luck < railed + stalls:
            for along in np.arange(low + 6.0, min(low + 26.0, high - 4.0), 4.4):
                spot = _place(axis, float(along), line + 1.9 * inwards)
                if plan.keeps_free((spot[0] - 2.0, spot[1] - 2.0), (spot[0] + 2.0, spot[1] + 2.0)):
                    add_stall(builder, rng, *spot, KERB_M, outwards + 0.5 * np.pi)
        elif luck < railed + stalls + 0.1:
            spot = _place(axis, rng.uniform(low + 6.0, high - 6.0), line + 1.6 * inwards)
            if plan.keeps_free((spot[0] - 2.5, spot[1] - 2.5), (spot[0] + 2.5, spot[1] + 2.5)):
                add_bus_shelter(builder, *spot, KERB_M, outwards)


def add_overhead(builder: MeshBuilder, rng: np.random.Generator, plan: CityPlan, lines: float) -> None:
    """Hang lines along that share of the streets, and lamps on wires across others."""
    for axis, street, others in plan.streets():
        luck = rng.random()
        side = float(rng.choice([-1.0, 1.0]))
        line = street.middle_m + side * (street.half_width_m + 0.45)
        crosses_corridor = axis == 0 and -18.0 < street.middle_m < plan.facade_m + 1.0
        ends_at_front = axis == 1 and street.middle_m == 0.0
        if luck < lines and not crosses_corridor:
            last = plan.facade_m - 24.0 if ends_at_front else _LIVELY_M
            along = np.arange(-_LIVELY_M, last, rng.uniform(26.0, 33.0))
            feet = np.array([(*_place(axis, float(at), line), -KERB_M) for at in along])
            add_line(builder, rng, feet, "wood" if rng.random() < 0.6 else "concrete")
        elif luck < lines + 0.3:
            for along_m in np.arange(-_LIVELY_M, _LIVELY_M, rng.uniform(22.0, 30.0)).tolist():
                if _off_crossings(along_m, others, 1.0) and not plan.is_built_over(axis, street, along_m):
                    _add_hung_lamp(builder, rng, plan, axis, street, along_m)


def _add_hung_lamp(
    builder: MeshBuilder, rng: np.random.Generator, plan: CityPlan, axis: int, street: Street, along_m: float
) -> None:
    """A lamp in the middle of a wire between the houses of both sides."""
    height = KERB_M + rng.uniform(6.2, 8.0)
    wall_m = street.half_width_m + PAVEMENT_M
    ends = [_place(axis, along_m, street.middle_m + side * wall_m) for side in (-1, 1)]
    beyond = [_place(axis, along_m, street.middle_m + side * (wall_m + 1.0)) for side in (-1, 1)]
    held = all(any(_holds(house, spot, height) for house in plan.houses) for spot in beyond)
    if not held or not plan.keeps_free(*ends):
        return
    start, end = (np.array([*spot, -height]) for spot in ends)
    add_wires(builder, start, end, 0.03)
    middle = 0.5 * (start + end) + np.array([0.0, 0.0, 0.03 * np.linalg.norm(end - start)])
    add_bars(builder, middle, middle + np.array([0.0, 0.0, 0.25]), 0.015)
    low = -float(middle[2]) - 0.45
    add_box(builder, (middle[0], middle[1]), (0.4, 0.4), low, low + 0.25, "paint", (0.9, 0.9, 0.9), taper=0.5)


def _holds(house: House, spot: Point, height_m: float) -> bool:
    plot = house.plot
    inside = (
        plot.north_low_m <= spot[0] <= plot.north_high_m and plot.east_low_m <= spot[1] <= plot.east_high_m
    )
    return inside and house.floors * FACADE_CELL_M > height_m


def _add_house_things(builder: MeshBuilder, rng: np.random.Generator, plan: CityPlan) -> None:
    """Scaffolding, arcades and awnings on the fronts of houses."""
    scaffolds, arcades, awnings = rng.uniform(0.0, 0.08), rng.uniform(0.0, 0.15), rng.uniform(0.1, 0.4)
    for house in plan.houses:
        for start, end, outwards in house.fronts:
            luck = rng.random()
            out = np.array(outwards)
            if not plan.keeps_free(start, tuple(np.array(end) + 3.0 * out)):
                continue
            if luck < scaffolds:
                height = house.floors * FACADE_CELL_M
                add_scaffold(builder, rng, start, end, outwards, KERB_M, height)
            elif luck < scaffolds + arcades:
                low, high = (np.array(corner) + 1.3 * out for corner in (start, end))
                walk = (float(low[0]), float(low[1])), (float(high[0]), float(high[1]))
                add_covered_walk(builder, rng, *walk, KERB_M, 2.6)
            elif luck < scaffolds + arcades + awnings:
                along = np.array(end) - np.array(start)
                parts = max(1, int(np.linalg.norm(along) / 6.0))
                for part in range(parts):
                    if rng.random() < 0.7:
                        low = np.array(start) + along * (part + 0.1) / parts
                        high = np.array(start) + along * (part + 0.8) / parts
                        wall = (float(low[0]), float(low[1])), (float(high[0]), float(high[1]))
                        add_awning(builder, rng, *wall, outwards, KERB_M)


def _add_bridges(builder: MeshBuilder, rng: np.random.Generator, plan: CityPlan) -> None:
    """Footbridges between houses, over streets; in some cities a railway on a viaduct."""
    streets = plan.streets()
    for _ in range(int(rng.integers(0, 4))):
        axis, street, others = streets[int(rng.integers(len(streets)))]
        along, width = rng.uniform(-90.0, 90.0), rng.uniform(1.8, 3.5)
        wall_m = street.half_width_m + PAVEMENT_M + 0.4
        ends = [_place(axis, along, street.middle_m + side * wall_m) for side in (-1, 1)]
        free = plan.keeps_free(*ends) and _off_crossings(along, others, 3.0)
        if free and not plan.is_built_over(axis, street, along):
            clear = rng.uniform(4.3, 7.0)
            add_bridge(builder, rng, ends[0], ends[1], KERB_M, clear, width, stairs=False)
    if rng.random() < 0.25:
        street = plan.easts[0] if rng.random() < 0.5 else plan.easts[-1]
        ends = [(along, street.middle_m) for along in (-_LIVELY_M, _LIVELY_M)]
        add_bridge(builder, rng, ends[0], ends[1], 0.0, 5.2, 4.5, stairs=False, span_m=18.0)
