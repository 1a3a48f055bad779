"""Lorries and buses of true size."""

from __future__ import annotations

import numpy as np

from uavdepth.scenes.mesh import Mesh, MeshBuilder
from uavdepth.scenes.solids import add_box
from uavdepth.scenes.wheels import add_wheel

_DARK = (0.22, 0.22, 0.23)


def lorry(rng: np.random.Generator) -> Mesh:
    """A rigid lorry of 6 to 10 m with a box, a tarpaulin or a low bed; "paint" is the cab's colour."""
    builder = MeshBuilder()
    length, width = float(rng.uniform(6.0, 10.0)), float(rng.uniform(2.2, 2.5))
    nose, cab = 0.5 * length, float(rng.uniform(1.7, 2.2))
    cab_top, floor = float(rng.uniform(2.4, 2.9)), float(rng.uniform(0.95, 1.15))
    add_box(builder, (0.0, 0.0), (length - 0.3, 0.9), 0.55, floor, "rubber")
    add_box(builder, (nose - 0.5 * cab, 0.0), (cab, width), 0.4, 1.5, "paint")
    add_box(builder, (nose - 0.5 * cab - 0.08, 0.0), (cab - 0.16, width - 0.1), 1.5, 2.2, "car_glass")
    add_box(builder, (nose - 0.5 * cab - 0.05, 0.0), (cab - 0.1, width), 2.2, cab_top, "paint")
    bed = length - cab - 0.25
    middle = (-0.5 * length + 0.5 * bed, 0.0)
    kind = rng.choice(["box", "tarpaulin", "bed", "tank"], p=[0.45, 0.25, 0.15, 0.15])
    if kind == "bed":
        add_box(builder, middle, (bed, width), floor, floor + 0.5, "planks")
        add_box(builder, middle, (0.7 * bed, 0.8 * width), floor + 0.5, floor + 1.1, "soil", taper=0.6)
    else:
        texture = {"box": "paint", "tarpaulin": "fabric", "tank": "corrugated"}[str(kind)]
        tint = rng.uniform(0.3, 1.15, 3) if kind == "tarpaulin" else np.full(3, rng.uniform(0.8, 1.2))
        top = float(rng.uniform(2.6, 3.0)) if kind == "tank" else float(rng.uniform(3.1, 3.9))
        add_box(builder, middle, (bed, width), floor, top, texture, tint, top_texture="plaster")
    _add_lights(builder, length, width, 0.75)
    axles = [nose - 0.55 * cab, -0.5 * length + 1.3]
    for ahead in axles + ([axles[1] + 1.25] if length > 8.5 else []):
        for side in (0.5 * width - 0.16, -0.5 * width + 0.16):
            add_wheel(builder, ahead, side, 0.48, 0.3)
    return builder.build()


def bus(rng: np.random.Generator) -> Mesh:
    """A city bus or coach of 10 to 12 m; "paint" is its colour."""
    builder = MeshBuilder()
    length, width = float(rng.uniform(10.0, 12.2)), 2.5
    top = float(rng.uniform(2.9, 3.5))
    sill = float(rng.uniform(1.1, 1.5))
    add_box(builder, (0.0, 0.0), (length, width), 0.33, sill, "paint")
    add_box(builder, (0.0, 0.0), (length - 0.06, width - 0.06), sill, top - 0.45, "car_glass")
    posts = np.arange(-0.5 * length + 1.4, 0.5 * length - 0.8, 1.6)
    for ahead in posts:
        add_box(builder, (float(ahead), 0.0), (0.1, width), sill, top - 0.45, "paint", (0.5, 0.5, 0.5))
    add_box(builder, (0.0, 0.0), (length, width), top - 0.45, top, "paint", top_texture="plaster")
    add_box(builder, (-0.2 * length, 0.0), (2.2, 1.6), top, top + 0.25, "plaster")
    add_box(builder, (0.5 * length, 0.0), (0.04, 1.5), top - 0.42, top - 0.12, "rubber", (1.5, 3.5, 4.0))
    _add_lights(builder, length, width, 0.7)
    for ahead in (0.5 * length - 2.7, -0.5 * length + 3.3):
        for side in (0.5 * width - 0.14, -0.5 * width + 0.14):
            add_wheel(builder, ahead, side, 0.48, 0.3)
    return builder.build()


def fork_lift(rng: np.random.Generator) -> Mesh:
    """A fork-lift truck, forks to the north; "paint" is its colour."""
    builder = MeshBuilder()
    add_box(builder, (-0.5, 0.0), (1.9, 1.1), 0.2, 0.95, "paint")
    add_box(builder, (-1.2, 0.0), (0.6, 1.1), 0.95, 1.25, "paint")
    for ahead in (0.25, -1.0):
        for side in (0.48, -0.48):
            add_box(builder, (ahead, side), (0.07, 0.07), 0.95, 2.1, "paint", _DARK)
    add_box(builder, (-0.38, 0.0), (1.4, 1.1), 2.1, 2.16, "paint", _DARK)
    lift = float(rng.uniform(0.1, 1.5))
    for side in (0.3, -0.3):
        add_box(builder, (0.55, side), (0.12, 0.12), 0.1, 2.2 + 0.5 * lift, "paint", _DARK)
        add_box(builder, (1.15, 0.6 * side), (1.1, 0.12), lift, lift + 0.05, "paint", _DARK)
    if rng.random() < 0.6:
        add_box(builder, (1.2, 0.0), (1.0, 1.2), lift + 0.05, lift + rng.uniform(0.3, 1.2), "planks")
    for ahead, radius in ((0.3, 0.33), (-1.1, 0.26)):
        for side in (0.5, -0.5):
            add_wheel(builder, ahead, side, radius, 0.2)
    return builder.build()


def _add_lights(builder: MeshBuilder, length: float, width: float, height: float) -> None:
    for end, tint in ((0.5, (2.6, 2.8, 2.8)), (-0.5, (0.4, 0.4, 3.0))):
        for side in (0.4 * width, -0.4 * width):
            add_box(builder, (end * length, side), (0.05, 0.3), height, height + 0.18, "rubber", tint)
