"""What grows and lies between trees: bushes, tufts, fallen logs."""

from __future__ import annotations

import numpy as np

from uavdepth.scenes.mesh import MeshBuilder
from uavdepth.scenes.shapes import box_uv, lumpy_sphere
from uavdepth.scenes.tree_parts import add_leaf_ball, add_tube, leaf_tint


def add_bush(
    builder: MeshBuilder,
    rng: np.random.Generator,
    north_m: float,
    east_m: float,
    ground_down_m: float,
    height_m: float,
    autumn: float = 0.0,
) -> None:
    """Plant one bush, leaves down to the ground, about as wide as high."""
    tint = leaf_tint(rng, autumn)
    for _ in range(int(rng.integers(1, 4))):
        side = rng.normal(0.0, 0.3 * height_m, 2)
        size = height_m * rng.uniform(0.4, 0.6)
        centre = np.array([north_m + side[0], east_m + side[1], ground_down_m - 0.7 * size])
        add_leaf_ball(builder, rng, centre, (size, size, 0.8 * size), tint, 1, shards=12)


def add_tuft(builder: MeshBuilder, rng: np.random.Generator, height_m: float, texture: str = "grass") -> None:
    """Grow one tuft of grass or fern at the origin: blades that lean outwards."""
    blades = 9
    heading = rng.uniform(0.0, 2 * np.pi, blades)
    out = np.column_stack([np.cos(heading), np.sin(heading), np.zeros(blades)])
    side = np.column_stack([-out[:, 1], out[:, 0], np.zeros(blades)]) * 0.13 * height_m
    root = out * 0.08 * height_m
    lean = rng.uniform(0.3, 0.9, (blades, 1)) * height_m
    tip = root + out * lean - np.array([0.0, 0.0, 1.0]) * height_m * rng.uniform(0.6, 1.0, (blades, 1))
    corners = np.stack([root - side, root + side, tip], axis=1).reshape(-1, 3)
    faces = np.arange(3 * blades).reshape(-1, 3)
    builder.add(
        corners, faces, box_uv(corners, faces), texture, rng.uniform(0.7, 1.2, (blades, 1)) * np.ones(3)
    )


def add_log(
    builder: MeshBuilder,
    rng: np.random.Generator,
    north_m: float,
    east_m: float,
    ground_down_m: float,
    length_m: float,
    radius_m: float,
) -> None:
    """Lay one fallen trunk on the ground, in any direction, with a few broken branches."""
    heading = rng.uniform(0.0, 2 * np.pi)
    along = np.array([np.cos(heading), np.sin(heading), rng.normal(0.0, 0.03)])
    centre = np.array([north_m, east_m, ground_down_m - 0.8 * radius_m])
    steps = np.linspace(-0.5, 0.5, 5)[:, None] * length_m
    line = centre + steps * along + rng.normal(0.0, 0.06, (5, 3)) * [1.0, 1.0, 0.4]
    radii = radius_m * np.array([1.0, 0.95, 0.88, 0.8, 0.7])
    shade = np.full(3, rng.uniform(0.7, 1.0))
    add_tube(builder, line, radii, 7, "bark", shade)
    for end, radius in ((line[0], radii[0]), (line[-1], radii[-1])):
        cap, faces = lumpy_sphere(rng, 0, (0.97 * radius,) * 3, 0.1)
        builder.add(cap + end, faces, box_uv(cap, faces), "bark", shade * [0.9, 1.05, 1.15])
    for _ in range(int(rng.integers(2, 5))):
        start = line[int(rng.integers(1, 4))]
        tip = start + rng.normal(0.0, 0.5, 3) * [1.0, 1.0, 0.3] - [0.0, 0.0, rng.uniform(0.3, 1.2)]
        add_tube(builder, np.array([start, tip]), [0.25 * radius_m, 0.02], 4, "bark", shade)
