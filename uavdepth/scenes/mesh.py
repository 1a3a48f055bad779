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
    _tint: list[NDArray[np.float32]] = field(default_factory=list)
    _kind: list[tuple[int, int, int, bool]] = field(default_factory=list)
    """Vertices, faces, texture's number and smoothness of each part."""
    _numbers: dict[str, int] = field(default_factory=dict)

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
        # As unsigned numbers, negative ones are large: one pass finds both kinds of mistake.
        if triangles.size and triangles.view(np.uint32).max() >= len(vertices):
            raise SceneError(f"faces name vertices {triangles.min()} to {triangles.max()} of {len(vertices)}")
        uv = np.asarray(uv_m, np.float32)
        corners = uv[triangles] if uv.ndim == 2 else uv
        if corners.shape != (len(triangles), 3, 2):
            raise SceneError(f"texture coordinates have shape {uv.shape}, not (N, 2) or (M, 3, 2)")
        if texture not in self._numbers:
            self._numbers[texture] = len(self._numbers)
        self._vertices.append(vertices)
        self._faces.append(triangles)
        self._uv.append(corners)
        self._tint.append(np.asarray(tint, np.float32))
        self._kind.append((len(vertices), len(triangles), self._numbers[texture], smooth))

    def build(self) -> Mesh:
        """Everything added so far as one mesh. Raises SceneError when nothing was added."""
        if not self._faces:
            raise SceneError("the scene has no triangles")
        vertex_count, face_count, texture, smooth = np.array(self._kind).T
        faces = np.concatenate(self._faces)
        first = np.cumsum(vertex_count) - vertex_count
        faces += np.repeat(first, face_count).astype(np.int32)[:, None]
        tint = np.empty((len(faces), 3), np.float32)
        end = 0
        for count, color in zip(face_count, self._tint, strict=True):
            tint[end : end + count] = color
            end += count
        return Mesh(
            np.concatenate(self._vertices),
            faces,
            np.concatenate(self._uv),
            np.repeat(texture, face_count).astype(np.int32),
            tint,
            np.repeat(smooth, face_count).astype(bool),
            tuple(self._numbers),
        )
