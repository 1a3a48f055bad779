"""Houses: facades with windows at true size, shops, roofs and what stands on them."""

from __future__ import annotations

import numpy as np

from uavdepth.scenes.mesh import MeshBuilder
from uavdepth.scenes.solids import Point, Rect, add_box, add_boxes, add_slab, add_wall
from uavdepth.scenes.textures_facade import FACADE_CELL_M

STYLES = ("brick_facade", "plaster_facade", "panel_facade", "glass_facade")
_BLIND = {
    "brick_facade": "brick",
    "plaster_facade": "plaster",
    "panel_facade": "concrete",
    "glass_facade": "concrete",
}
_GABLE_CHANCE = 0.35
_SHOP_CHANCE = 0.55


def add_house(
    builder: MeshBuilder, rng: np.random.Generator, plot: Rect, floors: int, ground_m: float
) -> None:
    """A house that fills a plot.

    Args:
        builder: the scene's mesh.
        rng: source of its style.
        plot: its foot, metres.
        floors: storeys of three metres, the ground floor included.
        ground_m: height of the pavement over down = 0.
    """
    style = str(rng.choice(STYLES, p=(0.32, 0.34, 0.2, 0.14)))
    tint = rng.uniform(0.78, 1.1) * rng.uniform(0.92, 1.08, 3)
    ground_floor = "shop" if rng.random() < _SHOP_CHANCE else style
    first_m = ground_m + FACADE_CELL_M
    top_m = ground_m + floors * FACADE_CELL_M
    corners = plot.corners
    for start, end in zip(corners, corners[1:] + corners[:1], strict=True):
        shift = FACADE_CELL_M * int(rng.integers(2))
        shop_tint = tint if ground_floor == style else rng.uniform(0.7, 1.1, 3)
        add_wall(builder, start, end, ground_m, first_m, ground_floor, shop_tint, shift)
        add_wall(builder, start, end, first_m, top_m, style, tint, shift)
        if rng.random() < 0.6:
            _add_balconies(builder, rng, start, end, floors, ground_m)
    _add_cornice(builder, plot, top_m, tint)
    if floors <= 5 and rng.random() < _GABLE_CHANCE:
        ridge_m = add_gable(builder, rng, plot, top_m, _BLIND[style], tint)
        add_chimney(builder, rng, plot, top_m, ridge_m)
    else:
        _add_flat_roof(builder, rng, plot, top_m, _BLIND[style], tint)


def _add_cornice(builder: MeshBuilder, plot: Rect, top_m: float, tint: np.ndarray) -> None:
    wide = plot.shrunk(-0.3)
    centre = (0.5 * (wide.north_low_m + wide.north_high_m), 0.5 * (wide.east_low_m + wide.east_high_m))
    size = (wide.north_high_m - wide.north_low_m, wide.east_high_m - wide.east_low_m)
    add_box(builder, centre, size, top_m - 0.25, top_m + 0.1, "plaster", tint * 0.9)
    add_slab(builder, wide, top_m - 0.25, "plaster", tint * 0.7)


def _add_balconies(
    builder: MeshBuilder, rng: np.random.Generator, start: Point, end: Point, floors: int, ground_m: float
) -> None:
    """Every second window of one column of cells gets a balcony."""
    along = np.array(end) - np.array(start)
    length = float(np.linalg.norm(along))
    along /= length
    outwards = np.array([-along[1], along[0]])
    cells = int(length // FACADE_CELL_M)
    if cells < 1 or floors < 3:
        return
    column = int(rng.integers(cells))
    turn = float(np.arctan2(along[1], along[0]))
    tint = rng.uniform(0.5, 1.1, 3)
    place = np.array(start) + along * (column + 0.5) * FACADE_CELL_M
    bases = ground_m + np.repeat(np.arange(1, floors), 2) * FACADE_CELL_M
    # One of the two sides lies inside the house, unseen: the ring's direction need not be known.
    sides = np.tile([1.0, -1.0], floors - 1)[:, None]
    add_boxes(builder, place + sides * outwards * 0.55, (2.2, 1.1), bases, 0.15, "concrete", turn_rad=turn)
    fronts = place + sides * outwards * 1.07
    add_boxes(builder, fronts, (2.2, 0.06), bases + 0.15, 0.95, "paint", tint, turn)


def _add_flat_roof(
    builder: MeshBuilder, rng: np.random.Generator, plot: Rect, top_m: float, blind: str, tint: np.ndarray
) -> None:
    corners = plot.corners
    add_slab(builder, plot, top_m + 0.12, "gravel", (0.8, 0.8, 0.8))
    inner = plot.shrunk(0.3).corners
    for ring in (corners, inner):
        for start, end in zip(ring, ring[1:] + ring[:1], strict=True):
            add_wall(builder, start, end, top_m, top_m + 0.7, blind, tint)
    for _ in range(int(rng.integers(1, 4))):
        north = rng.uniform(plot.north_low_m + 2, plot.north_high_m - 2)
        east = rng.uniform(plot.east_low_m + 2, plot.east_high_m - 2)
        size = (rng.uniform(1.0, 2.6), rng.uniform(1.0, 2.6))
        texture = str(rng.choice(["concrete", "corrugated", "brick"]))
        add_box(builder, (north, east), size, top_m, top_m + rng.uniform(1.0, 2.8), texture)


def add_gable(
    builder: MeshBuilder,
    rng: np.random.Generator,
    plot: Rect,
    top_m: float,
    blind: str,
    tint: np.ndarray,
    roof: str = "roof_tiles",
    eaves_m: float = 0.0,
) -> float:
    """A roof of two slopes with gables.

    Args:
        builder: the scene's mesh.
        rng: source of its pitch and colour.
        plot: the house's foot, metres.
        top_m: height of its walls over down = 0.
        blind: texture of the gables.
        tint: BGR factor of the gables.
        roof: texture of the slopes.
        eaves_m: how far the slopes reach over the walls.

    Returns:
        Height of the ridge over down = 0.
    """
    deep = plot.north_high_m - plot.north_low_m
    wide = plot.east_high_m - plot.east_low_m
    ridge_m = top_m + 0.5 * min(deep, wide) * rng.uniform(0.6, 1.0)
    a, b, c, d = plot.corners  # south-west, south-east, north-east, north-west
    if wide >= deep:
        middle = 0.5 * (plot.north_low_m + plot.north_high_m)
        first, last = (middle, plot.east_low_m), (middle, plot.east_high_m)
        slopes, gables = [(a, b, last, first), (c, d, first, last)], [(d, a, first), (b, c, last)]
    else:
        middle = 0.5 * (plot.east_low_m + plot.east_high_m)
        first, last = (plot.north_low_m, middle), (plot.north_high_m, middle)
        slopes, gables = [(b, c, last, first), (d, a, first, last)], [(a, b, first), (c, d, last)]
    roof_tint = rng.uniform(0.7, 1.1)
    for corners in slopes:
        (low_a, low_b, high_b, high_a), drop_m = _overhanging(corners, eaves_m, ridge_m - top_m)
        length = float(np.hypot(low_b[0] - low_a[0], low_b[1] - low_a[1]))
        run = float(np.hypot(high_a[0] - low_a[0], high_a[1] - low_a[1]))
        slope = float(np.hypot(run, ridge_m - top_m + drop_m))
        foot_m = top_m - drop_m
        vertices = [(*low_a, -foot_m), (*low_b, -foot_m), (*high_b, -ridge_m), (*high_a, -ridge_m)]
        uv = [(0.0, slope), (length, slope), (length, 0.0), (0.0, 0.0)]
        builder.add(vertices, [(0, 1, 2), (0, 2, 3)], uv, "roof_tiles", np.full(3, roof_tint))
    for left, right, peak in gables:
        width = float(np.hypot(right[0] - left[0], right[1] - left[1]))
        rise = ridge_m - top_m
        vertices = [(*left, -top_m), (*right, -top_m), (*peak, -ridge_m)]
        builder.add(vertices, [(0, 1, 2)], [(0.0, rise), (width, rise), (width / 2, 0.0)], blind, tint)
    return ridge_m


def add_chimney(
    builder: MeshBuilder, rng: np.random.Generator, plot: Rect, top_m: float, ridge_m: float
) -> None:
    """A chimney somewhere on a roof, a little higher than its ridge."""
    place = (
        rng.uniform(plot.north_low_m + 2, plot.north_high_m - 2),
        rng.uniform(plot.east_low_m + 2, plot.east_high_m - 2),
    )
    add_box(builder, place, (0.8, 0.6), top_m, ridge_m + 0.9, "brick")


def _overhanging(
    corners: tuple[Point, Point, Point, Point], eaves_m: float, rise_m: float
) -> tuple[list[Point], float]:
    """A slope's corners (two low, two high) drawn out over the walls, and how far its foot drops."""
    low_a, low_b, high_b, high_a = np.array(corners, float)
    along, down = low_b - low_a, low_a - high_a
    run = float(np.linalg.norm(down))
    along, down = along / np.linalg.norm(along) * eaves_m, down / run * eaves_m
    spread = (low_a - along + down, low_b + along + down, high_b + along, high_a - along)
    return [(float(north), float(east)) for north, east in spread], eaves_m * rise_m / run
