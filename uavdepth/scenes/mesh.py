"""Textured triangles of a rendered world, and the builder that scenes put them together with."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from uavdepth.errors import SceneError


@dataclass(frozen=True)
class Mesh:
    """Triangles in NED.

    Args:
        vertices_m: (N, 3) float32 north, east, down in metres.
        faces: (M, 3) int32 vertex indices.
        uv_m: (M, 3, 2) float32 texture coordinates of each corner in metres on the surface; a texture
            repeats every `size_m` of its own.
        texture: (M,) int32 index into `texture_names`.
        tint: (M, 3) float32 factor on the texture's colour, BGR.
        smooth: (M,) bool, True where the shading normal is interpolated (terrain), False where flat.
        texture_names: names of the textures in use.
    """

    vertices_m: NDArray[np.float32]
    faces: NDArray[np.int32]
    uv_m: NDArray[np.float32]
    texture: NDArray[np.int32]
    tint: NDArray[np.float32]
    smooth: NDArray[np.bool_]
    texture_names: tuple[str, ...]


@dataclass
class MeshBuilder:
    """Collects parts and joins them into one `Mesh`."""

    _vertices: list[NDArray[np.float32]] = field(default_factory=list)
    _faces: list[NDArray[np.int32]] = field(default_factory=list)
    _uv: list[NDArray[np.float32]] = field(default_factory=list)
    _texture: list[NDArray[np.int32]] = field(default_factory=list)
    _tint: list[NDArray[np.float32]] = field(default_factory=list)
    _smooth: list[NDArray[np.bool_]] = field(default_factory=list)
    _names: list[str] = field(default_factory=list)
    _vertex_count: int = 0

    def add(
        self,
        vertices_m: ArrayLike,
        faces: ArrayLike,
        uv_m: ArrayLike,
        texture: str,
        tint: ArrayLike = (1.0, 1.0, 1.0),
        smooth: bool = False,
    ) -> None:
        """Add triangles of one texture.

        Args:
            vertices_m: (N, 3) NED metres.
            faces: (M, 3) indices into these vertices.
            uv_m: (N, 2) per vertex or (M, 3, 2) per corner, metres on the surface.
            texture: a name that the scene's texture set knows.
            tint: (3,) or (M, 3) BGR factor.
            smooth: interpolate normals over these triangles.

        Raises:
            SceneError: arrays whose shapes do not fit together.
        """
        vertices = np.asarray(vertices_m, np.float32).reshape(-1, 3)
        triangles = np.asarray(faces, np.int32).reshape(-1, 3)
        if triangles.size and (triangles.min() < 0 or triangles.max() >= len(vertices)):
            raise SceneError(f"a face names vertex {triangles.max()} of {len(vertices)}")
        uv = np.asarray(uv_m, np.float32)
        corners = uv[triangles] if uv.ndim == 2 else uv
        if corners.shape != (len(triangles), 3, 2):
            raise SceneError(f"texture coordinates have shape {uv.shape}, not (N, 2) or (M, 3, 2)")
        if texture not in self._names:
            self._names.append(texture)
        count = len(triangles)
        self._vertices.append(vertices)
        self._faces.append(triangles + np.int32(self._vertex_count))
        self._uv.append(corners)
        self._texture.append(np.full(count, self._names.index(texture), np.int32))
        self._tint.append(np.ascontiguousarray(np.broadcast_to(np.asarray(tint, np.float32), (count, 3))))
        self._smooth.append(np.full(count, smooth))
        self._vertex_count += len(vertices)

    def build(self) -> Mesh:
        """Everything added so far as one mesh. Raises SceneError when nothing was added."""
        if not self._faces:
            raise SceneError("the scene has no triangles")
        return Mesh(
            np.concatenate(self._vertices),
            np.concatenate(self._faces),
            np.concatenate(self._uv),
            np.concatenate(self._texture),
            np.concatenate(self._tint),
            np.concatenate(self._smooth),
            tuple(self._names),
        )
