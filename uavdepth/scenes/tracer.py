"""Rays against triangles, on Embree through the embreex wheel."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from numpy.typing import NDArray

from uavdepth.scenes.mesh import Mesh

_MISS = -1
_FREE = -1
"""What embreex's OCCLUDED query returns for a ray that meets nothing (0 for one that is stopped)."""


@dataclass(frozen=True)
class Hits:
    """Nearest hit of each ray.

    Args:
        face: (N,) int32 face number, -1 where the ray meets nothing.
        u, v: (N,) float32 barycentric weights of the face's second and third corner.
        t: (N,) float32 distance in lengths of the ray's direction, +inf where the ray meets nothing.
    """

    face: NDArray[np.int32]
    u: NDArray[np.float32]
    v: NDArray[np.float32]
    t: NDArray[np.float32]


class RayTracer:
    """The triangles of one mesh in an Embree acceleration structure (watertight: `robust`)."""

    def __init__(self, mesh: Mesh) -> None:
        self._scene = EmbreeScene(robust=True)
        self._mesh = TriangleMesh(self._scene, mesh.vertices_m, mesh.faces)

    def nearest(self, origins_m: NDArray[np.float32], directions: NDArray[np.float32]) -> Hits:
        """First surface along each ray.

        Args:
            origins_m: (N, 3) or (3,) float32 NED; one origin serves all rays.
            directions: (N, 3) float32, any length above 0.
        """
        result = self._scene.run(
            _per_ray(origins_m, len(directions)),
            np.ascontiguousarray(directions, np.float32),
            query="INTERSECT",
            output=True,
        )
        face = result["primID"]
        return Hits(
            face, result["u"], result["v"], np.where(face == _MISS, np.float32(np.inf), result["tfar"])
        )

    def occluded(self, origins_m: NDArray[np.float32], directions: NDArray[np.float32]) -> NDArray[np.bool_]:
        """(N,) True where anything lies along the ray, at any distance. Arguments as for `nearest`."""
        if len(directions) == 0:
            return np.zeros(0, np.bool_)
        answer = self._scene.run(
            _per_ray(origins_m, len(directions)),
            np.ascontiguousarray(directions, np.float32),
            query="OCCLUDED",
        )
        return np.asarray(answer != _FREE)


def _per_ray(origins_m: NDArray[np.float32], count: int) -> NDArray[np.float32]:
    return np.ascontiguousarray(np.broadcast_to(np.asarray(origins_m, np.float32), (count, 3)))
