"""Tower cranes and gantry cranes."""

from __future__ import annotations

import numpy as np

from uavdepth.scenes.bars import add_bars, add_wires
from uavdepth.scenes.lattice import add_lattice
from uavdepth.scenes.mesh import MeshBuilder
from uavdepth.scenes.solids import Point, add_box

_PAINTS_BGR = ((0.15, 0.75, 1.0), (0.2, 0.25, 0.85), (0.85, 0.88, 0.9), (0.75, 0.45, 0.15))


def add_tower_crane(
    builder: MeshBuilder, rng: np.random.Generator, north_m: float, east_m: float, ground_m: float
) -> None:
    """A tower crane 28 to 45 m high with a jib of 25 to 45 m."""
    paint = _PAINTS_BGR[int(rng.integers(len(_PAINTS_BGR)))]
    height, jib = rng.uniform(28.0, 45.0), rng.uniform(25.0, 45.0)
    turn = rng.uniform(0.0, 2 * np.pi)
    ahead = np.array([np.cos(turn), np.sin(turn), 0.0])
    up = np.array([0.0, 0.0, -1.0])
    foot = np.array([north_m, east_m, -ground_m])
    top = foot + height * up
    add_box(builder, (north_m, east_m), (4.5, 4.5), ground_m - 0.2, ground_m + 0.8, "concrete")
    add_lattice(builder, foot, top, (1.6, 1.6), 0.09, paint)
    add_lattice(builder, top - 0.3 * jib * ahead, top + jib * ahead, (1.1, 0.9), 0.06, paint, bay=1.5)
    peak = top + 6.0 * up
    add_lattice(builder, top, peak, (1.4, 0.3), 0.06, paint)
    ends = np.array([top + 0.7 * jib * ahead, top - 0.28 * jib * ahead])
    add_wires(builder, np.repeat(peak[None], 2, axis=0), ends, 0.0, 0.03)
    back = top - 0.27 * jib * ahead
    add_box(builder, (back[0], back[1]), (2.2, 1.2), -top[2] - 2.4, -top[2], "concrete", turn_rad=turn)
    cab = top + 1.3 * np.array([-ahead[1], ahead[0], 0.0])
    add_box(builder, (cab[0], cab[1]), (1.6, 1.3), -top[2] - 2.2, -top[2] - 0.1, "car_glass", turn_rad=turn)
    trolley = top + rng.uniform(0.3, 0.9) * jib * ahead
    hook = trolley - rng.uniform(0.2, 0.5) * height * up
    add_bars(builder, trolley, hook, 0.03, (0.2, 0.2, 0.2))
    add_box(builder, (hook[0], hook[1]), (0.5, 0.5), -hook[2] - 0.8, -hook[2], "paint", (0.2, 0.7, 0.9))


def add_gantry_crane(
    builder: MeshBuilder, rng: np.random.Generator, start: Point, end: Point, ground_m: float, clear_m: float
) -> None:
    """A beam on two legs from `start` to `end`, `clear_m` above the ground, with a hook."""
    paint = _PAINTS_BGR[int(rng.integers(len(_PAINTS_BGR)))]
    low, high = np.array([*start, -ground_m]), np.array([*end, -ground_m])
    up = np.array([0.0, 0.0, -1.0])
    along = (high - low) / np.linalg.norm(high - low)
    across = np.array([-along[1], along[0], 0.0])
    beam = clear_m + 0.8
    reach = 0.08 * np.linalg.norm(high - low) * along
    add_lattice(builder, low + beam * up - reach, high + beam * up + reach, (1.6, 1.6), 0.08, paint)
    for foot in (low, high):
        legs = np.array([foot + 2.2 * across, foot - 2.2 * across])
        tops = np.array([foot + 0.7 * across, foot - 0.7 * across]) + clear_m * up
        add_bars(builder, legs, tops, 0.2, paint)
        add_bars(builder, legs[:1] + 0.6 * up, legs[1:] + 0.6 * up, 0.15, paint)
    spot = low + rng.uniform(0.25, 0.75) * (high - low)
    hook = spot + rng.uniform(0.35, 0.7) * clear_m * up
    add_bars(builder, spot + clear_m * up, hook, 0.025, (0.2, 0.2, 0.2))
    add_box(builder, (hook[0], hook[1]), (0.4, 0.4), -hook[2] - 0.7, -hook[2], "paint", (0.2, 0.7, 0.9))
