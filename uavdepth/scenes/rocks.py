"""Boulders: spheres dented by noise and cut by planes as broken stone is."""

from __future__ import annotations

import numpy as np

from uavdepth.scenes.mesh import MeshBuilder
from uavdepth.scenes.shapes import box_uv, lumpy_sphere


def add_boulder(
    builder: MeshBuilder,
    rng: np.random.Generator,
    north_m: float,
    east_m: float,
    ground_down_m: float,
    size_m: float,
    texture: str = "rock",
    sunk: float = 0.3,
    tint: float = 1.0,
) -> None:
    """Lay one boulder.

    Args:
        builder: the scene's mesh.
        rng: source of its shape.
        north_m, east_m: its middle.
        ground_down_m: the ground there, NED down.
        size_m: mean diameter.
        texture: what it is of.
        sunk: part of its height that lies below the ground.
        tint: brightness.
    """
    radii = 0.5 * size_m * rng.uniform(0.75, 1.25, 3) * [1.0, 1.0, 0.85]
    vertices, faces = lumpy_sphere(rng, 2 if size_m > 1.2 else 1, radii, 0.22, 0.02)
    cuts = rng.normal(0.0, 1.0, (7, 3))
    cuts /= np.linalg.norm(cuts, axis=1, keepdims=True)
    for cut in cuts:
        beyond = vertices @ cut - 0.5 * size_m * rng.uniform(0.6, 0.95)
        vertices = vertices - np.maximum(beyond, 0.0)[:, None] * cut * 0.92
    bottom = vertices[:, 2].max()
    height = bottom - vertices[:, 2].min()
    vertices = vertices + np.array([north_m, east_m, ground_down_m - bottom + sunk * height])
    shade = tint * rng.uniform(0.8, 1.15) * rng.uniform(0.95, 1.05, 3)
    builder.add(vertices, faces, box_uv(vertices, faces), texture, shade)
