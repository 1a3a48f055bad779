"""Round shapes of nature: deformed spheres, tapering tubes, and texture coordinates at true size."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

Shape = tuple[NDArray[np.float64], NDArray[np.int32]]
"""(N, 3) vertices and (M, 3) faces, wound so that (b - a) x (c - a) points outwards."""


@lru_cache(maxsize=4)
def unit_sphere(subdivisions: int) -> Shape:
    """Icosahedron of radius 1 whose faces are split into four `subdivisions` times (20, 80, 320 faces)."""
    golden = (1 + 5**0.5) / 2
    corners = [(s * 1.0, t * golden, 0.0) for s in (-1, 1) for t in (-1, 1)]
    points = [np.roll(corner, shift) for shift in range(3) for corner in corners]
    vertices = [point / np.linalg.norm(point) for point in points]
    # The faces of an icosahedron are the triples of mutually nearest corners.
    near = np.array([[0 < np.linalg.norm(a - b) < 1.2 for b in vertices] for a in vertices])
    faces: list[tuple[int, int, int]] = []
    for a in range(12):
        for b in range(a + 1, 12):
            for c in range(b + 1, 12):
                if near[a, b] and near[b, c] and near[a, c]:
                    normal = np.cross(vertices[b] - vertices[a], vertices[c] - vertices[a])
                    faces.append((a, b, c) if normal @ vertices[a] > 0 else (a, c, b))
    for _ in range(subdivisions):
        middles: dict[tuple[int, int], int] = {}
        finer: list[tuple[int, int, int]] = []
        for face in faces:
            split = []
            for first, second in zip(face, face[1:] + face[:1], strict=True):
                key = (min(first, second), max(first, second))
                if key not in middles:
                    middle = vertices[first] + vertices[second]
                    middles[key] = len(vertices)
                    vertices.append(middle / np.linalg.norm(middle))
                split.append(middles[key])
            a, b, c = face
            ab, bc, ca = split
            finer += [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
        faces = finer
    return np.array(vertices), np.array(faces, np.int32)


def lumpy_sphere(
    rng: np.random.Generator, subdivisions: int, radii_m: ArrayLike, roughness: float, jitter: float = 0.0
) -> Shape:
    """A sphere dented by smooth waves.

    Args:
        rng: source of the dents.
        subdivisions: fineness, see `unit_sphere`.
        radii_m: half axes north, east, down in metres.
        roughness: relative depth of the waves, 0 to about 0.5.
        jitter: relative size of the noise of single vertices.
    """
    directions, faces = unit_sphere(subdivisions)
    waves = rng.normal(0.0, 2.2, (5, 3))
    phases = rng.uniform(0.0, 2 * np.pi, 5)
    swell = np.sin(directions @ waves.T + phases).mean(axis=1) * 1.6
    radius = 1.0 + roughness * swell + rng.normal(0.0, jitter, len(directions))
    vertices = directions * np.maximum(radius, 0.3)[:, None] * np.asarray(radii_m, float)
    return vertices, faces


def tube(centres_m: ArrayLike, radii_m: ArrayLike, sides: int) -> tuple[Shape, NDArray[np.float64]]:
    """A tapering tube around a line, open at both ends.

    Args:
        centres_m: (R, 3) ring centres.
        radii_m: (R,) ring radii.
        sides: flat sides around; the seam's vertices are doubled so that the texture closes there.

    Returns:
        The shape and (N, 2) texture coordinates in metres, around and along.
    """
    centres = np.asarray(centres_m, float)
    radii = np.asarray(radii_m, float)
    along = np.gradient(centres, axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    helper = np.array([1.0, 0.0, 0.0]) if abs(along[0, 0]) < 0.8 else np.array([0.0, 1.0, 0.0])
    right = np.cross(along, helper)
    right /= np.linalg.norm(right, axis=1, keepdims=True)
    ahead = np.cross(along, right)
    turn = np.linspace(0.0, 2 * np.pi, sides + 1)
    ring = np.cos(turn)[None, :, None] * right[:, None] + np.sin(turn)[None, :, None] * ahead[:, None]
    vertices = centres[:, None] + radii[:, None, None] * ring
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(centres, axis=0), axis=1))])
    around = turn * radii.mean()
    uv = np.stack(np.broadcast_arrays(around[None, :], length[:, None]), axis=-1)
    first = (np.arange(len(centres) - 1)[:, None] * (sides + 1) + np.arange(sides)[None, :]).ravel()
    above = first + sides + 1
    faces = np.concatenate(
        [np.stack([first, first + 1, above], axis=1), np.stack([first + 1, above + 1, above], axis=1)]
    )
    return (vertices.reshape(-1, 3), faces.astype(np.int32)), uv.reshape(-1, 2)


def grid_faces(rows: int, columns: int) -> NDArray[np.int32]:
    """(M, 3) faces of a grid of vertices numbered row by row: two triangles a cell, sharing the diagonal from
    its first corner; they face up where rows go north and columns east."""
    corner = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)[None, :]).ravel()
    up, right, both = corner + columns, corner + 1, corner + columns + 1
    faces = np.concatenate([np.stack([corner, both, up], axis=1), np.stack([corner, right, both], axis=1)])
    return faces.astype(np.int32)


def box_uv(vertices_m: ArrayLike, faces: ArrayLike) -> NDArray[np.float64]:
    """(M, 3, 2) texture coordinates in metres, each face projected along the axis that it faces most."""
    vertices = np.asarray(vertices_m, float)
    corners = vertices[np.asarray(faces)]
    normals = np.abs(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
    facing = normals.argmax(axis=1)
    columns = np.array([[1, 2], [0, 2], [1, 0]])[facing]
    return np.take_along_axis(corners, columns[:, None, :], axis=2)
