"""`works`: an industrial yard of halls, tanks, silos, pipe bridges, gantries and containers.

No training data are drawn from it: it shows how a network copes with a kind of place that it never saw.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from uavdepth.scenes.bars import add_wires
from uavdepth.scenes.cars import PAINTS_BGR, CarPark
from uavdepth.scenes.corridor import Corridor
from uavdepth.scenes.cranes import add_gantry_crane
from uavdepth.scenes.description import SceneDescription
from uavdepth.scenes.fences import add_fence
from uavdepth.scenes.lorries import fork_lift, lorry
from uavdepth.scenes.mesh import MeshBuilder
from uavdepth.scenes.overhead import add_line, add_mast
from uavdepth.scenes.people import Crowd
from uavdepth.scenes.plant_parts import (
    add_containers,
    add_hall,
    add_heap,
    add_pipe_bridge,
    add_platform,
    add_silo,
    add_tank,
)
from uavdepth.scenes.plots import PlotPlan, Site, add_patches, fill_plots, patch_lines
from uavdepth.scenes.scaffolding import add_scaffold
from uavdepth.scenes.solids import Rect, add_box
from uavdepth.scenes.stamps import Stamps
from uavdepth.scenes.terrain import level_ground
from uavdepth.scenes.weather import draw_weather

_CELL_M, _ROAD_M = 30.0, 9.0
_CELLS = 3
"""Cells from the middle to each side."""

_REACH_M = (_CELLS + 0.5) * _CELL_M
_HORIZON_M = 700.0


def build(seed: int) -> SceneDescription:
    """The works of one seed: a hall ends the view to the north."""
    rng = np.random.default_rng([seed, 0x3042])
    builder = MeshBuilder()
    end_m = float(rng.uniform(33.0, 43.0))
    yard = Site(rng, builder, Corridor(end_m, half_width_m=4.5, front_depth_m=10.0))
    _add_ground(yard)
    half = float(rng.uniform(18.0, 30.0))
    add_hall(builder, rng, Rect(end_m, end_m + 16.0, -half, half), float(rng.uniform(9.5, 13.0)), True)
    taken = Rect(end_m - 2.0, end_m + 18.0, -half - 2.0, half + 2.0)
    parts = (
        (_hall, 0.16), (_tanks, 0.12), (_silos, 0.1), (_containers, 0.16), (_gantry, 0.08), (_platforms, 0.1),
        (_heaps, 0.08), (_parking, 0.08), (_substation, 0.06), (_scaffolded, 0.06),
    )  # fmt: skip
    fill_plots(yard, PlotPlan(_CELLS, _CELL_M, _ROAD_M, jitter_m=2.0), parts, taken)
    _add_pipes(yard)
    _add_movers(yard)
    _add_border(yard)
    weather = draw_weather(rng, (0.0006, 0.007))
    return weather.over(builder.build(), level_ground, _REACH_M - 15.0)


def _add_ground(yard: Site) -> None:
    """Patches of concrete, asphalt and gravel."""
    rng = yard.rng
    kinds = rng.choice(["concrete", "asphalt", "gravel"], size=3)

    def look(outermost: bool) -> tuple[str, ArrayLike]:
        texture = "grass" if outermost else str(kinds[int(rng.integers(3))])
        return texture, np.full(3, rng.uniform(0.85, 1.05))

    add_patches(yard.builder, patch_lines(_REACH_M, 15.0, _HORIZON_M), look)


def _hall(yard: Site, cell: Rect) -> None:
    rng = yard.rng
    add_hall(yard.builder, rng, cell.shrunk(float(rng.uniform(0.0, 3.0))), float(rng.uniform(5.5, 14.0)))


def _grid(cell: Rect, rows: int) -> list[tuple[float, float]]:
    """Middles of rows x rows equal parts of a cell."""
    step = (np.arange(rows) + 0.5) / rows
    norths = cell.north_low_m + step * (cell.north_high_m - cell.north_low_m)
    easts = cell.east_low_m + step * (cell.east_high_m - cell.east_low_m)
    return [(float(north), float(east)) for north in norths for east in easts]


def _tanks(yard: Site, cell: Rect) -> None:
    rng = yard.rng
    rows = int(rng.integers(1, 3))
    for north, east in _grid(cell, rows):
        add_tank(yard.builder, rng, north, east, float(rng.uniform(0.28, 0.42)) * _CELL_M * 0.7 / rows)
    ring = cell.shrunk(-0.5).corners
    for start, end in zip(ring, ring[1:] + ring[:1], strict=True):
        middle = (0.5 * (start[0] + end[0]), 0.5 * (start[1] + end[1]))
        size = (abs(end[0] - start[0]) + 0.3, abs(end[1] - start[1]) + 0.3)
        add_box(yard.builder, middle, size, 0.0, 0.9, "concrete")


def _silos(yard: Site, cell: Rect) -> None:
    rng = yard.rng
    for north, east in _grid(cell, int(rng.integers(2, 4))):
        if rng.random() < 0.75:
            add_silo(yard.builder, rng, north, east, float(rng.uniform(1.5, 2.6)))


def _containers(yard: Site, cell: Rect) -> None:
    add_containers(yard.builder, yard.rng, cell)


def _gantry(yard: Site, cell: Rect) -> None:
    rng = yard.rng
    north = float(rng.uniform(cell.north_low_m + 3.0, cell.north_high_m - 3.0))
    clear = float(rng.uniform(5.0, 10.0))
    add_gantry_crane(yard.builder, rng, (north, cell.east_low_m), (north, cell.east_high_m), 0.0, clear)
    inner = Rect(cell.north_low_m, cell.north_high_m, cell.east_low_m + 3.0, cell.east_high_m - 3.0)
    for _ in range(int(rng.integers(3, 9))):
        place = rng.uniform((inner.north_low_m, inner.east_low_m), (inner.north_high_m, inner.east_high_m))
        size = rng.uniform(0.6, 4.0, 2)
        texture = str(rng.choice(["planks", "paint", "concrete", "corrugated"]))
        top = float(rng.uniform(0.3, 1.8))
        add_box(
            yard.builder,
            (place[0], place[1]),
            (size[0], size[1]),
            0.0,
            top,
            texture,
            rng.uniform(0.5, 1.1, 3),
        )


def _platforms(yard: Site, cell: Rect) -> None:
    rng = yard.rng
    for north, east in _grid(cell, 2):
        half = rng.uniform(2.5, 4.2, 2)
        plot = Rect(north - half[0], north + half[0], east - half[1], east + half[1])
        add_platform(yard.builder, rng, plot, float(rng.uniform(3.0, 6.5)))


def _heaps(yard: Site, cell: Rect) -> None:
    for north, east in _grid(cell, 2):
        add_heap(yard.builder, yard.rng, north, east)


def _parking(yard: Site, cell: Rect) -> None:
    cars = CarPark(yard.rng)
    for north in np.arange(cell.north_low_m + 2.5, cell.north_high_m, 2.8):
        for east in (cell.east_low_m + 3.0, cell.east_high_m - 3.0):
            if yard.rng.random() < 0.6:
                cars.park(float(north), east, 0.0, 0.5 * np.pi)
    cars.build(yard.builder)


def _substation(yard: Site, cell: Rect) -> None:
    """Transformers behind a fence, wires between portals."""
    rng, builder = yard.rng, yard.builder
    ring = cell.corners
    add_fence(builder, rng, [(*spot, 0.0) for spot in [*ring, ring[0]]], "chain")
    for north, east in _grid(cell, 2):
        add_box(builder, (north, east), (2.2, 3.2), 0.0, 2.6, "paint", (0.5, 0.55, 0.5))
        for side in (-1.0, 0.0, 1.0):
            add_box(builder, (north, east + side), (0.25, 0.25), 2.6, 3.7, "paint", (0.3, 0.4, 0.7))
    for east in (cell.east_low_m + 2.0, cell.east_high_m - 2.0):
        add_gantry_crane(
            builder, rng, (cell.north_low_m + 2.0, east), (cell.north_high_m - 2.0, east), 0.0, 7.0
        )
    norths = np.linspace(cell.north_low_m + 4.0, cell.north_high_m - 4.0, 6)
    starts = np.column_stack([norths, np.full(6, cell.east_low_m + 2.0), np.full(6, -7.4)])
    ends = starts + np.array([0.0, cell.east_high_m - cell.east_low_m - 4.0, 0.0])
    add_wires(builder, starts, ends, 0.03)


def _scaffolded(yard: Site, cell: Rect) -> None:
    """A block under repair."""
    rng = yard.rng
    plot = cell.shrunk(3.0)
    height = float(rng.uniform(6.0, 12.0))
    add_hall(yard.builder, rng, plot, height)
    a, b, c, d = plot.corners
    for start, end, out in ((a, b, (-1.0, 0.0)), (b, c, (0.0, 1.0)), (c, d, (1.0, 0.0)), (d, a, (0.0, -1.0))):
        if rng.random() < 0.6:
            add_scaffold(yard.builder, rng, start, end, out, 0.0, height)


def _add_pipes(yard: Site) -> None:
    """Pipe bridges along roads between the cells; they stay out of the corridor."""
    rng = yard.rng
    for _ in range(int(rng.integers(2, 6))):
        line = _CELL_M * (int(rng.integers(-_CELLS, _CELLS)) + 0.5)
        low, high = sorted(rng.uniform(-_REACH_M + 5.0, _REACH_M - 5.0, 2))
        eastward = rng.random() < 0.5
        start, end = ((line, low), (line, high)) if eastward else ((low, line), (high, line))
        corners = (start[0] - 2.0, start[1] - 2.0), (end[0] + 2.0, end[1] + 2.0)
        if high - low > 15.0 and yard.corridor.is_free(*corners):
            add_pipe_bridge(yard.builder, rng, start, end, float(rng.uniform(3.8, 6.5)))


def _add_movers(yard: Site) -> None:
    """Lorries, fork-lifts and people on the roads."""
    rng = yard.rng
    lorries = Stamps(rng, [lorry] * 3, {"paint": PAINTS_BGR})
    lifts = Stamps(rng, [fork_lift] * 2, {"paint": PAINTS_BGR})
    crowd = Crowd(rng, walking=0.5)
    for _ in range(int(rng.integers(30, 70))):
        line = _CELL_M * (int(rng.integers(-_CELLS, _CELLS)) + 0.5) + rng.choice([-2.2, 2.2])
        along = rng.uniform(-_REACH_M + 8.0, _REACH_M - 8.0)
        eastward = rng.random() < 0.5
        north, east = (line, along) if eastward else (along, line)
        heading = (0.5 * np.pi if eastward else 0.0) + rng.choice([0.0, np.pi]) + rng.normal(0.0, 0.08)
        luck = rng.random()
        reach = 6.0 if luck < 0.25 else 1.5
        if not yard.corridor.is_free_around((north, east), reach)[0]:
            continue
        if luck < 0.25:
            lorries.put(north, east, 0.0, heading)
        elif luck < 0.5:
            lifts.put(north, east, 0.0, heading)
        else:
            crowd.put(north, east, 0.0, heading)
    lorries.build(yard.builder)
    lifts.build(yard.builder)
    crowd.build(yard.builder)


def _add_border(yard: Site) -> None:
    """A fence around everything, a line beside it, masts on the roads' corners."""
    rng, builder = yard.rng, yard.builder
    edge = _REACH_M - 1.0
    ring = [(-edge, -edge), (-edge, edge), (edge, edge), (edge, -edge)]
    add_fence(builder, rng, [(*spot, 0.0) for spot in [*ring, ring[0]]], "mesh", 2.0)
    feet = [(float(north), edge + 8.0, 0.0) for north in np.arange(-120.0, 121.0, 40.0)]
    add_line(builder, rng, feet, "concrete" if rng.random() < 0.6 else "pylon")
    for _ in range(int(rng.integers(3, 10))):
        cross = _CELL_M * (rng.integers(-_CELLS, _CELLS, 2) + 0.5)
        if yard.corridor.is_free_around(cross, 10.0)[0]:
            add_mast(builder, rng, float(cross[0]) + 4.0, float(cross[1]) + 4.0, 0.0)
