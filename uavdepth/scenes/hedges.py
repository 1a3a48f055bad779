"""Clipped hedges."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from uavdepth.scenes.mesh import MeshBuilder
from uavdepth.scenes.shapes import box_uv, grid_faces
from uavdepth.scenes.tree_parts import leaf_tint

_STEP_M = 0.8


def add_hedge(
    builder: MeshBuilder,
    rng: np.random.Generator,
    start_ned_m: ArrayLike,
    end_ned_m: ArrayLike,
    height_m: float,
    width_m: float,
    texture: str = "leaves",
) -> None:
    """A hedge from foot to foot, (3,) NED each, with uneven faces."""
    start, end = np.asarray(start_ned_m, float), np.asarray(end_ned_m, float)
    length = float(np.linalg.norm(end - start))
    steps = max(2, round(length / _STEP_M)) + 1
    along = (end - start) / length
    across = np.array([-along[1], along[0], 0.0])
    side, up = 0.5 * width_m, height_m
    ring = [(side, -0.2), (1.1 * side, 0.5 * up), (0.9 * side, 0.95 * up), (0.0, up)]
    profile = np.array(ring + [(-aside, rise) for aside, rise in ring[-2::-1]])
    line = start + np.linspace(0.0, length, steps)[:, None] * along
    vertices = line[:, None] + profile[:, :1] * across - profile[:, 1:] * np.array([0.0, 0.0, 1.0])
    vertices += rng.normal(0.0, 0.06 * width_m, vertices.shape)
    # The ends close over: the last rings shrink to their middle.
    for end_ring in (0, -1):
        middle = line[end_ring] - [0.0, 0.0, 0.45 * height_m]
        vertices[end_ring] = middle + 0.35 * (vertices[end_ring] - middle)
    flat = vertices.reshape(-1, 3)
    faces = grid_faces(steps, len(profile))
    tint = (leaf_tint(rng, 0.0) if texture == "leaves" else np.ones(3)) * rng.uniform(
        0.8, 1.1, (len(faces), 1)
    )
    builder.add(flat, faces, box_uv(flat, faces), texture, tint, smooth=True)
