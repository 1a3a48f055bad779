"""What stands in a street: lamp posts, signs, bins, bollards, benches."""

from __future__ import annotations

import numpy as np

from uavdepth.scenes.mesh import MeshBuilder
from uavdepth.scenes.shapes import tube
from uavdepth.scenes.solids import add_box


def _pole(
    builder: MeshBuilder,
    line_m: list[tuple[float, float, float]],
    radius_m: float,
    tint: tuple[float, float, float] = (0.35, 0.37, 0.38),
) -> None:
    (vertices, faces), uv = tube(line_m, [radius_m] * len(line_m), 8)
    builder.add(vertices, faces, uv, "paint", tint, smooth=True)


def add_lamp(
    builder: MeshBuilder,
    rng: np.random.Generator,
    north_m: float,
    east_m: float,
    ground_m: float,
    arm: tuple[float, float],
) -> None:
    """A lamp post; `arm` is the unit direction (north, east) in which the lamp reaches out."""
    height = rng.uniform(4.5, 8.0)
    top = -(ground_m + height)
    foot = (north_m, east_m, -ground_m)
    reach = rng.uniform(0.4, 1.2)
    head = (north_m + reach * arm[0], east_m + reach * arm[1], top - 0.25)
    shade = rng.uniform(0.2, 0.6)
    _pole(builder, [foot, (north_m, east_m, top)], rng.uniform(0.05, 0.09), (shade, shade, shade))
    _pole(builder, [(north_m, east_m, top + 0.05), head], 0.04, (shade, shade, shade))
    add_box(
        builder,
        (head[0], head[1]),
        (0.3, 0.6),
        -head[2] - 0.06,
        -head[2] + 0.1,
        "paint",
        (0.9, 0.9, 0.9),
        float(np.arctan2(arm[1], arm[0])) + np.pi / 2,
    )
    add_box(
        builder, (north_m, east_m), (0.28, 0.28), ground_m, ground_m + 0.6, "paint", (shade, shade, shade)
    )


def add_sign(
    builder: MeshBuilder,
    rng: np.random.Generator,
    north_m: float,
    east_m: float,
    ground_m: float,
    facing_rad: float,
) -> None:
    """A traffic sign or poster board on a pole."""
    height = rng.uniform(2.3, 3.0)
    _pole(
        builder,
        [(north_m, east_m, -ground_m), (north_m, east_m, -(ground_m + height))],
        0.035,
        (0.7, 0.7, 0.7),
    )
    size = rng.uniform(0.5, 0.95)
    add_box(
        builder,
        (north_m, east_m),
        (0.05, size),
        ground_m + height - size,
        ground_m + height,
        "board",
        rng.uniform(0.8, 1.1, 3),
        facing_rad,
    )


def add_small_thing(
    builder: MeshBuilder, rng: np.random.Generator, north_m: float, east_m: float, ground_m: float
) -> None:
    """A bin, a bollard, a cabinet or a bench."""
    kind = rng.choice(["bin", "bollard", "cabinet", "bench"])
    turn = rng.choice([0.0, np.pi / 2])
    if kind == "bin":
        add_box(
            builder,
            (north_m, east_m),
            (0.5, 0.5),
            ground_m,
            ground_m + 1.0,
            "paint",
            rng.uniform(0.2, 0.6, 3),
            turn,
        )
    elif kind == "bollard":
        _pole(
            builder,
            [(north_m, east_m, -ground_m), (north_m, east_m, -ground_m - 0.95)],
            0.07,
            (0.3, 0.3, 0.32),
        )
    elif kind == "cabinet":
        add_box(
            builder, (north_m, east_m), (0.4, 0.9), ground_m, ground_m + 1.3, "paint", (0.6, 0.66, 0.62), turn
        )
    else:
        add_box(
            builder,
            (north_m, east_m),
            (0.45, 1.7),
            ground_m + 0.4,
            ground_m + 0.48,
            "corrugated",
            (0.5, 0.7, 0.9),
            turn,
        )
        for side in (-0.7, 0.7):
            place = (north_m - side * float(np.sin(turn)), east_m + side * float(np.cos(turn)))
            add_box(builder, place, (0.4, 0.08), ground_m, ground_m + 0.4, "paint", (0.3, 0.3, 0.3), turn)
