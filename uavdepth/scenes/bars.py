"""Thin things: straight bars and hanging wires, many at once."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from uavdepth.scenes.mesh import MeshBuilder

WIRE_RADIUS_M = 0.012
"""Of overhead wires: 24 mm, a bundled low-voltage cable."""

_GREY_BGR = (0.35, 0.37, 0.38)


def add_bars(
    builder: MeshBuilder,
    starts_m: ArrayLike,
    ends_m: ArrayLike,
    radius_m: ArrayLike,
    tint: ArrayLike = _GREY_BGR,
    texture: str = "paint",
    sides: int = 4,
) -> None:
    """K straight prisms without lids.

    Args:
        builder: the scene's mesh.
        starts_m, ends_m: (K, 3) ends of their middle lines, NED. Bars of no length are left out.
        radius_m: of the circle through their edges; one, or (K,).
        tint: (3,) BGR factor.
        texture: what they are of.
        sides: faces around each.
    """
    starts, ends = np.asarray(starts_m, float).reshape(-1, 3), np.asarray(ends_m, float).reshape(-1, 3)
    radii = np.broadcast_to(np.asarray(radius_m, float), (len(starts),))
    lengths = np.linalg.norm(ends - starts, axis=1)
    real = lengths > 1e-6
    if not real.any():
        return
    starts, ends, radii, lengths = starts[real], ends[real], radii[real], lengths[real]
    along = (ends - starts) / lengths[:, None]
    helper = np.where(np.abs(along[:, 2:]) < 0.8, [[0.0, 0.0, 1.0]], [[1.0, 0.0, 0.0]])
    right = np.cross(along, helper)
    right /= np.linalg.norm(right, axis=1, keepdims=True)
    ahead = np.cross(along, right)
    turn = np.linspace(0.0, 2 * np.pi, sides + 1) + np.pi / sides
    ring = np.cos(turn)[None, :, None] * right[:, None] + np.sin(turn)[None, :, None] * ahead[:, None]
    ring *= radii[:, None, None]
    vertices = np.stack([starts[:, None] + ring, ends[:, None] + ring], axis=1)
    around = np.broadcast_to(np.linspace(0.0, 1.0, sides + 1) * 2 * np.pi * radii[:, None], ring.shape[:2])
    reach = np.broadcast_to(lengths[:, None], around.shape)
    uv = np.stack([np.stack([around, 0.0 * reach], -1), np.stack([around, reach], -1)], axis=1)
    first = np.arange(sides)
    pattern = np.concatenate(
        [
            np.stack([first, first + 1, first + sides + 1], axis=1),
            np.stack([first + 1, first + sides + 2, first + sides + 1], axis=1),
        ]
    )
    faces = pattern + 2 * (sides + 1) * np.arange(len(starts))[:, None, None]
    builder.add(vertices.reshape(-1, 3), faces.reshape(-1, 3), uv.reshape(-1, 2), texture, tint)


def add_path_of_bars(
    builder: MeshBuilder,
    points_m: ArrayLike,
    radius_m: float,
    tint: ArrayLike = _GREY_BGR,
    texture: str = "paint",
    sides: int = 4,
) -> None:
    """Bars from each of (N, 3) points to the next."""
    points = np.asarray(points_m, float)
    add_bars(builder, points[:-1], points[1:], radius_m, tint, texture, sides)


def hanging(starts_m: ArrayLike, ends_m: ArrayLike, sag: float, pieces: int = 10) -> NDArray[np.float64]:
    """(K, pieces + 1, 3) points of wires between (K, 3) ends.

    The parabola that a catenary is as long as it sags little.

    Args:
        starts_m, ends_m: NED.
        sag: depth of the middle below the straight line, as a part of the span.
        pieces: straight pieces of each.
    """
    starts, ends = np.asarray(starts_m, float).reshape(-1, 3), np.asarray(ends_m, float).reshape(-1, 3)
    t = np.linspace(0.0, 1.0, pieces + 1)[None, :, None]
    points = starts[:, None] * (1 - t) + ends[:, None] * t
    span = np.linalg.norm(ends - starts, axis=1)
    points[..., 2] += (4 * sag * span)[:, None] * (t * (1 - t))[..., 0]
    return np.asarray(points)


def add_wires(
    builder: MeshBuilder,
    starts_m: ArrayLike,
    ends_m: ArrayLike,
    sag: float = 0.02,
    radius_m: float = WIRE_RADIUS_M,
    tint: ArrayLike = (0.16, 0.16, 0.17),
) -> None:
    """Hang K wires between (K, 3) ends; arguments as in `hanging`."""
    points = hanging(starts_m, ends_m, sag)
    add_bars(builder, points[:, :-1], points[:, 1:], radius_m, tint, sides=3)
