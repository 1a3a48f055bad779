"""What trees are put together from: trunks, boughs, balls of leaves."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from uavdepth.scenes.mesh import MeshBuilder
from uavdepth.scenes.shapes import box_uv, lumpy_sphere, tube

ROOT_DEPTH_M = 0.4
"""Trunks start below the ground so that no gap shows on slopes."""

_LEAF_GREENS_BGR = (
    (0.75, 1.0, 0.85),
    (0.7, 1.0, 1.0),
    (0.9, 1.0, 0.75),
    (0.55, 0.95, 1.15),
    (0.8, 0.85, 0.8),
)
_AUTUMN_BGR = ((0.35, 0.85, 1.5), (0.3, 0.6, 1.5), (0.4, 1.0, 1.4))


def leaf_tint(rng: np.random.Generator, autumn: float) -> NDArray[np.float64]:
    """Colour factor of one plant's leaves: a green, or with the chance `autumn` yellow to red."""
    palette = _AUTUMN_BGR if rng.random() < autumn else _LEAF_GREENS_BGR
    return np.array(palette[int(rng.integers(len(palette)))]) * rng.uniform(0.75, 1.1)


def add_tube(
    builder: MeshBuilder,
    line: NDArray[np.float64],
    radii: NDArray[np.float64] | list[float],
    sides: int,
    texture: str,
    tint: NDArray[np.float64],
) -> None:
    """Add a tube along a line (R, 3) with radii (R,) in metres, rounded when it has more than 4 sides."""
    (vertices, faces), uv = tube(line, radii, sides)
    builder.add(vertices, faces, uv, texture, tint, smooth=sides > 4)


def add_trunk(
    builder: MeshBuilder,
    rng: np.random.Generator,
    foot: NDArray[np.float64],
    height_m: float,
    radius_m: float,
    texture: str,
    sway: float,
) -> NDArray[np.float64]:
    """Add a trunk that widens at its roots. Returns its (5, 3) centre line from the foot to the top."""
    heights = np.array([0.0, 0.06, 0.35, 0.7, 1.0]) * height_m
    lean = np.cumsum(rng.normal(0.0, sway * height_m, (5, 2)) * [[0.0], [0.1], [0.6], [0.7], [0.6]], axis=0)
    line = foot + np.column_stack([lean, -heights])
    line[0, 2] = foot[2] + ROOT_DEPTH_M
    radii = radius_m * np.array([1.7, 1.08, 0.92, 0.66, 0.36])
    add_tube(builder, line, radii, 7, texture, np.full(3, rng.uniform(0.75, 1.1)))
    return line


def add_leaf_ball(
    builder: MeshBuilder,
    rng: np.random.Generator,
    centre: NDArray[np.float64],
    radii_m: tuple[float, float, float],
    tint: NDArray[np.float64],
    subdivisions: int,
    shards: int,
) -> None:
    """A cloud of leaves: a lumpy ball, darker below, with single twigs standing out of it."""
    vertices, faces = lumpy_sphere(rng, subdivisions, radii_m, 0.3, 0.09)
    height = -vertices[faces].mean(axis=1)[:, 2] / radii_m[2]
    shade = (0.86 + 0.16 * height) * rng.uniform(0.9, 1.1, len(faces))
    uv = box_uv(vertices + centre, faces)
    builder.add(vertices + centre, faces, uv, "leaves", tint * shade[:, None], smooth=True)

    directions = rng.normal(0.0, 1.0, (shards, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    size = np.clip(0.3 * min(radii_m), 0.12, 0.5)
    root = directions * np.array(radii_m) * rng.uniform(0.7, 0.85, (shards, 1))
    across = np.cross(directions, rng.normal(0.0, 1.0, (shards, 3)))
    across *= size / np.linalg.norm(across, axis=1, keepdims=True)
    tip = directions * (np.array(radii_m) + size * rng.uniform(0.3, 1.3, (shards, 1)))
    corners = np.stack([root - across, root + across, tip], axis=1).reshape(-1, 3) + centre
    triangles = np.arange(3 * shards).reshape(-1, 3)
    shade = rng.uniform(0.8, 1.2, (shards, 1))
    builder.add(corners, triangles, box_uv(corners, triangles), "leaves", tint * shade, smooth=True)
