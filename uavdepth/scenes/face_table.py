"""What shading needs to know of each triangle, in one cache line per triangle."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from uavdepth.scenes.mesh import Mesh

NORMAL, U, V, TINT, TEXTURE, SMOOTH = 0, 3, 7, 11, 14, 15
"""Columns: unit normal (3); texture coordinates in repetitions as their change per metre along north, east,
down and their value at the NED origin (4 each); tint BGR (3); texture number; 1 where normals are smooth."""

_STEEPEST = 1e4
"""Largest change of a texture coordinate in metres per metre: triangles without area have no gradient."""

_CHUNK = 1 << 16
"""Triangles computed at a time in double precision, to keep the peak of memory low."""


def build_face_table(mesh: Mesh, per_metre: NDArray[np.float32]) -> NDArray[np.float32]:
    """(M, 16) float32, columns as above.

    Args:
        mesh: the triangles.
        per_metre: (T,) repetitions per metre of each texture.
    """
    table = np.empty((len(mesh.faces), 16), np.float32)
    for first in range(0, len(table), _CHUNK):
        part = slice(first, first + _CHUNK)
        _fill(table[part], mesh, part, per_metre)
    return table


def vertex_normals(mesh: Mesh) -> NDArray[np.float32]:
    """(V, 3) float32 unit normals of the vertices of smooth triangles, weighted by area; 0 elsewhere."""
    total = np.zeros((len(mesh.vertices_m), 3))
    faces = mesh.faces[mesh.smooth]
    a, b, c = (mesh.vertices_m[faces[:, corner]].astype(np.float64) for corner in range(3))
    area = np.cross(b - a, c - a)
    for corner in range(3):
        for axis in range(3):
            total[:, axis] += np.bincount(faces[:, corner], weights=area[:, axis], minlength=len(total))
    return _unit(total)


def _fill(table: NDArray[np.float32], mesh: Mesh, part: slice, per_metre: NDArray[np.float32]) -> None:
    faces = mesh.faces[part]
    a, b, c = (mesh.vertices_m[faces[:, corner]].astype(np.float64) for corner in range(3))
    e1, e2 = b - a, c - a
    uv = mesh.uv_m[part].astype(np.float64)
    # Dual basis of the edges in the face's plane: r1.e1 = 1, r1.e2 = 0 and the other way round.
    g11, g12, g22 = (np.einsum("ij,ij->i", x, y) for x, y in ((e1, e1), (e1, e2), (e2, e2)))
    determinant = np.maximum(g11 * g22 - g12 * g12, 1e-18)[:, None]
    r1 = (g22[:, None] * e1 - g12[:, None] * e2) / determinant
    r2 = (g11[:, None] * e2 - g12[:, None] * e1) / determinant
    repeat = per_metre[mesh.texture[part]].astype(np.float64)[:, None]
    table[:, NORMAL : NORMAL + 3] = _unit(np.cross(e1, e2))
    for axis, column in ((0, U), (1, V)):
        d1, d2 = uv[:, 1, axis, None] - uv[:, 0, axis, None], uv[:, 2, axis, None] - uv[:, 0, axis, None]
        gradient = np.clip(d1 * r1 + d2 * r2, -_STEEPEST, _STEEPEST) * repeat
        start = uv[:, 0, axis] * repeat[:, 0] - np.einsum("ij,ij->i", gradient, a)
        table[:, column : column + 3] = gradient
        table[:, column + 3] = start - np.floor(start)  # whole repetitions change nothing but rounding
    table[:, TINT : TINT + 3] = mesh.tint[part]
    table[:, TEXTURE] = mesh.texture[part]
    table[:, SMOOTH] = mesh.smooth[part]


def _unit(vectors: NDArray[np.float64]) -> NDArray[np.float32]:
    lengths = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(vectors / np.maximum(lengths, 1e-30), np.float32)
