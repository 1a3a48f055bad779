"""Low houses with pitched roofs, and what stands in their gardens."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uavdepth.scenes.bars import add_bars
from uavdepth.scenes.buildings import add_chimney, add_gable
from uavdepth.scenes.cars import CarPark
from uavdepth.scenes.fences import FenceKind, add_fence
from uavdepth.scenes.hedges import add_hedge
from uavdepth.scenes.mesh import MeshBuilder
from uavdepth.scenes.shelters import add_carport, add_covered_walk
from uavdepth.scenes.solids import Point, Rect, add_box, add_slab, add_wall
from uavdepth.scenes.textures_facade import FACADE_CELL_M

_WALLS = {"brick_facade": "brick", "plaster_facade": "plaster", "panel_facade": "concrete"}
_LOW_FENCES: tuple[FenceKind, ...] = ("pickets", "railing", "rails", "mesh", "boards")


@dataclass(frozen=True)
class Lot:
    """A house with its garden.

    Args:
        land: its ground.
        street: which way its street lies: north +1 or south -1.
        ground_m: height of the ground over down = 0.
        snowy: whether snow lies.
    """

    land: Rect
    street: float
    ground_m: float
    snowy: bool

    def from_street(self, near_m: float, far_m: float, left_m: float, right_m: float) -> Rect:
        """The rectangle between two distances from the street and two from the western edge."""
        front = self.land.north_high_m if self.street > 0 else self.land.north_low_m
        norths = sorted((front - self.street * near_m, front - self.street * far_m))
        return Rect(norths[0], norths[1], self.land.east_low_m + left_m, self.land.east_low_m + right_m)


def add_cottage(
    builder: MeshBuilder, rng: np.random.Generator, plot: Rect, floors: int, ground_m: float, snowy: bool
) -> None:
    """A house of one or two storeys under a pitched roof.

    Args:
        builder: the scene's mesh.
        rng: source of its make.
        plot: its foot, metres.
        floors: storeys below the roof.
        ground_m: height of the ground over down = 0.
        snowy: whether snow lies on the roof.
    """
    style = str(rng.choice(list(_WALLS), p=(0.4, 0.45, 0.15)))
    blind = "planks" if rng.random() < 0.25 else _WALLS[style]
    tint = rng.uniform(0.85, 1.15) * rng.uniform(0.92, 1.08, 3)
    top_m = ground_m + floors * FACADE_CELL_M
    ring = plot.corners
    for start, end in zip(ring, ring[1:] + ring[:1], strict=True):
        shift = FACADE_CELL_M * int(rng.integers(2))
        add_wall(builder, start, end, ground_m - 0.3, top_m, style, tint, shift)
    roof = "snow" if snowy else "roof_tiles"
    ridge_m = add_gable(builder, rng, plot, top_m, blind, tint, roof, eaves_m=float(rng.uniform(0.3, 0.8)))
    if rng.random() < 0.8:
        add_chimney(builder, rng, plot, top_m, ridge_m)
    if rng.random() < 0.4:
        middle = np.array([0.5 * (plot.north_low_m + plot.north_high_m), plot.east_low_m + 1.5])
        foot = np.array([*middle, -ridge_m])
        add_bars(builder, foot, foot - [0.0, 0.0, 1.8], 0.02)
        arms, half = foot - np.outer([1.2, 1.5, 1.8], [0.0, 0.0, 1.0]), np.array([0.4, 0.0, 0.0])
        add_bars(builder, arms - half, arms + half, 0.012, sides=3)


def add_lot(builder: MeshBuilder, rng: np.random.Generator, lot: Lot, cars: CarPark) -> list[Point]:
    """House, drive, garden and enclosure of a lot. Returns places in its garden for trees."""
    land, ground = lot.land, lot.ground_m
    width, depth = land.east_high_m - land.east_low_m, land.north_high_m - land.north_low_m
    add_slab(
        builder, land, ground + 0.01, "snow" if lot.snowy else "grass", np.full(3, rng.uniform(0.85, 1.1))
    )
    wide = FACADE_CELL_M * int(rng.integers(2, 1 + max(3, int((width - 5.0) // FACADE_CELL_M))))
    deep = FACADE_CELL_M * int(rng.integers(2, 4))
    setback = float(rng.uniform(3.5, max(4.5, min(8.0, depth - deep - 3.0))))
    drive_left = bool(rng.random() < 0.5)
    left = width - wide - 1.0 if drive_left else 1.0
    house = lot.from_street(setback, setback + deep, left, left + wide)
    add_cottage(builder, rng, house, 1 if rng.random() < 0.55 else 2, ground, lot.snowy)
    drive = (0.6, 3.6) if drive_left else (width - 3.6, width - 0.6)
    paved = lot.from_street(0.0, setback + 6.0, *drive)
    add_slab(builder, paved, ground + 0.02, str(rng.choice(["paving", "asphalt", "gravel", "concrete"])))
    if rng.random() < 0.5:
        add_carport(builder, rng, lot.from_street(setback, setback + 5.6, *drive), ground)
    elif rng.random() < 0.4:
        garage = lot.from_street(setback + 1.0, setback + 6.8, *drive)
        _add_garage(builder, rng, lot, garage)
    if rng.random() < 0.6:
        middle = 0.5 * (paved.east_low_m + paved.east_high_m)
        near = lot.from_street(2.8, 2.8, 0.0, 0.0).north_low_m
        cars.park(near, middle, ground + 0.02, 0.5 * np.pi - 0.5 * np.pi * lot.street + rng.normal(0.0, 0.03))
    if rng.random() < 0.25:
        rear = lot.from_street(setback + deep, setback + deep + 2.6, left + 0.5, left + wide - 0.5)
        middle_m = 0.5 * (rear.north_low_m + rear.north_high_m)
        add_covered_walk(builder, rng, (middle_m, rear.east_low_m), (middle_m, rear.east_high_m), ground, 2.5)
    _add_enclosure(builder, rng, lot, drive)
    return _garden_places(rng, lot, setback, deep, drive_left)


def _add_garage(builder: MeshBuilder, rng: np.random.Generator, lot: Lot, place: Rect) -> None:
    centre = (0.5 * (place.north_low_m + place.north_high_m), 0.5 * (place.east_low_m + place.east_high_m))
    size = (place.north_high_m - place.north_low_m, place.east_high_m - place.east_low_m)
    top = lot.ground_m + 2.5
    roof = "snow" if lot.snowy else "gravel"
    add_box(builder, centre, size, lot.ground_m, top, "plaster", rng.uniform(0.8, 1.1, 3), top_texture=roof)
    door = (place.north_high_m if lot.street > 0 else place.north_low_m, centre[1])
    add_box(builder, door, (0.06, 2.3), lot.ground_m, top - 0.4, "planks", rng.uniform(0.6, 1.2, 3))


def _add_enclosure(
    builder: MeshBuilder, rng: np.random.Generator, lot: Lot, drive: tuple[float, float]
) -> None:
    """Hedge, fence or nothing on each side; the drive stays open."""
    width = lot.land.east_high_m - lot.land.east_low_m
    front = lot.from_street(0.3, 0.3, 0.0, 0.0).north_low_m
    back = lot.from_street(lot.land.north_high_m - lot.land.north_low_m, 0.0, 0.0, 0.0)
    rear = back.north_low_m if lot.street > 0 else back.north_high_m
    west, east = lot.land.east_low_m + 0.2, lot.land.east_high_m - 0.2
    open_low, open_high = lot.land.east_low_m + drive[0], lot.land.east_low_m + drive[1]
    sides = [((front, west), (front, open_low)), ((front, open_high), (front, east))]
    # Beside the drive lies the neighbour's fence.
    sides = sides[:1] if drive[0] > 0.5 * width else sides[1:]
    low = _LOW_FENCES[int(rng.integers(len(_LOW_FENCES)))]
    hedge_front = rng.random() < 0.35
    for start, end in sides:
        if hedge_front:
            _hedge(builder, rng, lot, start, end, float(rng.uniform(0.8, 1.6)))
        elif rng.random() < 0.7:
            add_fence(builder, rng, [(*start, -lot.ground_m), (*end, -lot.ground_m)], low, 1.0)
    luck = rng.random()
    if luck < 0.4:
        kind: FenceKind = "boards" if rng.random() < 0.6 else "mesh"
        add_fence(builder, rng, [(*spot, -lot.ground_m) for spot in ((front, east), (rear, east))], kind)
    elif luck < 0.75:
        _hedge(builder, rng, lot, (front, east), (rear, east), float(rng.uniform(1.2, 2.2)))


def _hedge(
    builder: MeshBuilder, rng: np.random.Generator, lot: Lot, start: Point, end: Point, height_m: float
) -> None:
    texture = "snowy_needles" if lot.snowy else "leaves"
    feet = ((*start, -lot.ground_m), (*end, -lot.ground_m))
    add_hedge(builder, rng, *feet, height_m, float(rng.uniform(0.5, 0.9)), texture)


def _garden_places(
    rng: np.random.Generator, lot: Lot, setback: float, deep: float, drive_left: bool
) -> list[Point]:
    """Places for trees behind the house, and sometimes before it."""
    width, depth = lot.land.east_high_m - lot.land.east_low_m, lot.land.north_high_m - lot.land.north_low_m
    places = []
    rear = lot.from_street(setback + deep + 3.0, max(depth - 1.0, setback + deep + 3.5), 2.0, width - 2.0)
    for _ in range(int(rng.integers(0, 4))):
        places.append(
            (rng.uniform(rear.north_low_m, rear.north_high_m), rng.uniform(rear.east_low_m, rear.east_high_m))
        )
    if rng.random() < 0.4:
        left = width - 3.0 if drive_left else 3.0
        before = lot.from_street(2.5, 2.5, left, left)
        places.append((before.north_low_m, before.east_low_m))
    return places
