"""Many turned and scaled copies of a few templates: how a forest is planted quickly."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavdepth.scenes.mesh import Mesh, MeshBuilder

_WIDTH = (0.85, 1.15)
"""Slimmest and widest copies against the template."""


@dataclass(frozen=True)
class Template:
    """One thing that stands at the origin, ready to be copied.

    Args:
        mesh: its triangles, foot at (0, 0, 0).
        height_m: its height before scaling.
    """

    mesh: Mesh
    height_m: float

    @classmethod
    def of(cls, make: Callable[[MeshBuilder], None], height_m: float) -> Template:
        """Build a template by calling `make` with an empty builder."""
        builder = MeshBuilder()
        make(builder)
        return cls(builder.build(), height_m)

    @property
    def reach(self) -> float:
        """How far copies may stretch sideways from their foot, as a part of their height."""
        level = self.mesh.vertices_m[:, :2]
        return float(np.linalg.norm(level, axis=1).max()) * _WIDTH[1] / self.height_m


def add_copies(
    builder: MeshBuilder,
    rng: np.random.Generator,
    template: Template,
    feet_ned_m: NDArray[np.floating],
    heights_m: NDArray[np.floating],
) -> None:
    """Add K copies, each turned about its vertical axis and a little slimmer or wider than the template.

    Args:
        builder: the scene's mesh.
        rng: source of turns, widths and shades.
        template: what to copy.
        feet_ned_m: (K, 3) where.
        heights_m: (K,) how high each copy becomes.
    """
    count = len(feet_ned_m)
    if count == 0:
        return
    mesh = template.mesh
    scale = np.asarray(heights_m, float) / template.height_m
    width = scale * rng.uniform(*_WIDTH, count)
    turn = rng.uniform(0.0, 2 * np.pi, count)
    cosine, sine = (width * np.cos(turn))[:, None], (width * np.sin(turn))[:, None]
    shade = rng.uniform(0.8, 1.12, (count, 1, 1)) * rng.uniform(0.94, 1.06, (count, 1, 3))
    shift = rng.uniform(0.0, 8.0, (count, 1, 1, 2))
    for number, texture in enumerate(mesh.texture_names):
        part = mesh.texture == number
        used, local = np.unique(mesh.faces[part], return_inverse=True)
        x, y, z = mesh.vertices_m[used].T.astype(float)
        vertices = np.stack([cosine * x - sine * y, sine * x + cosine * y, scale[:, None] * z], axis=-1)
        vertices += np.asarray(feet_ned_m, float)[:, None, :]
        steps = np.arange(count)[:, None, None] * len(used)
        faces = local.reshape(1, -1, 3) + steps
        # The texture grows on the copy as on the template: larger trees have more leaves, not larger ones.
        uv = mesh.uv_m[part][None] * scale[:, None, None, None] + shift
        tint = mesh.tint[part][None] * shade
        builder.add(
            vertices.reshape(-1, 3),
            faces.reshape(-1, 3),
            uv.reshape(-1, 3, 2),
            texture,
            tint.reshape(-1, 3),
            smooth=bool(mesh.smooth[part][0]),
        )
