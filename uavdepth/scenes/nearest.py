"""Exact distance from a point to the nearest triangle."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from uavdepth.scenes.kernels import kernel

_BLOCK = 16
"""Triangles in a block: few enough that their common box is tight, many enough that boxes are few."""

_GROUP = 32
"""Blocks in a group, which has a box too."""

_CELLS = 1 << 10
"""Steps along each axis of the curve that brings neighbouring triangles together."""


class NearestSurface:
    """The triangles of one mesh in groups of blocks of neighbours, to find the one nearest to a point.

    Args:
        vertices_m: (N, 3) float32.
        faces: (M, 3) int32 vertex numbers.
    """

    def __init__(self, vertices_m: NDArray[np.float32], faces: NDArray[np.int32]) -> None:
        self._vertices = vertices_m
        self._faces = faces
        low = np.minimum.reduce([vertices_m[faces[:, corner]] for corner in range(3)])
        high = np.maximum.reduce([vertices_m[faces[:, corner]] for corner in range(3)])
        self._order = _neighbours_together(low, high)
        first = np.arange(0, len(faces), _BLOCK)
        self._low = np.minimum.reduceat(low[self._order], first)
        self._high = np.maximum.reduceat(high[self._order], first)
        first = np.arange(0, len(self._low), _GROUP)
        self._group_low = np.minimum.reduceat(self._low, first)
        self._group_high = np.maximum.reduceat(self._high, first)

    def distance_m(self, point_m: NDArray[np.float64], limit_m: float) -> float:
        """Metres from a (3,) point to the nearest triangle, or `limit_m` when none is nearer."""
        return float(
            _nearest(
                point_m,
                self._vertices,
                self._faces,
                self._order,
                self._low,
                self._high,
                self._group_low,
                self._group_high,
                limit_m,
            )
        )


def _neighbours_together(low: NDArray[np.float32], high: NDArray[np.float32]) -> NDArray[np.int32]:
    """Order of the triangles along a Morton curve, those of a like size together: one large triangle would
    spoil the box of 31 small ones."""
    size = np.linalg.norm(high - low, axis=1)
    octave = np.floor(np.log2(np.maximum(size, 1e-3))).astype(np.int64)
    middle = 0.5 * (low + high)
    start, span = middle.min(axis=0), np.maximum(np.ptp(middle, axis=0), 1e-6)
    cell = np.minimum((middle - start) / span * _CELLS, _CELLS - 1).astype(np.int64)
    code = np.zeros(len(low), np.int64)
    for bit in range(_CELLS.bit_length() - 1):
        for axis in range(3):
            code |= ((cell[:, axis] >> bit) & 1) << (3 * bit + axis)
    return np.lexsort((code, octave)).astype(np.int32)


@kernel
def _nearest(point, vertices, faces, order, low, high, group_low, group_high, limit):  # type: ignore[no-untyped-def]
    """Distance from `point` to the nearest triangle, at most `limit`.

    Args:
        point: (3,) float64. vertices: (N, 3) float32. faces: (M, 3) int32.
        order: (M,) int32 faces block by block. low, high: (B, 3) float32 boxes of the blocks.
        group_low, group_high: (G, 3) float32 boxes of the groups.
    """
    best = limit * limit
    gaps = np.empty(len(group_low), np.float64)
    nearest = 0
    for group in range(len(group_low)):
        gaps[group] = _gap(point, group_low, group_high, group)
        if gaps[group] < gaps[nearest]:
            nearest = group
    # The nearest box first: its triangles rule out almost all others.
    for turn in range(-1, len(group_low)):
        group = nearest if turn < 0 else turn
        if gaps[group] >= best:
            continue
        for block in range(group * _GROUP, min((group + 1) * _GROUP, len(low))):
            if _gap(point, low, high, block) >= best:
                continue
            for place in range(block * _BLOCK, min((block + 1) * _BLOCK, len(order))):
                f = order[place]
                a, b, c = vertices[faces[f, 0]], vertices[faces[f, 1]], vertices[faces[f, 2]]
                best = min(best, _squared(point, a, b, c))
    return math.sqrt(best)


@kernel
def _gap(point, low, high, number):  # type: ignore[no-untyped-def]
    """Squared distance from a point to a box, 0 inside."""
    gap = 0.0
    for axis in range(3):
        away = max(low[number, axis] - point[axis], point[axis] - high[number, axis], 0.0)
        gap += away * away
    return gap


@kernel
def _squared(p, a, b, c):  # type: ignore[no-untyped-def]
    """Squared distance from p to triangle a, b, c.

    After Ericson, Real-Time Collision Detection (2005), section 5.1.5.
    """
    abx, aby, abz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    acx, acy, acz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    apx, apy, apz = p[0] - a[0], p[1] - a[1], p[2] - a[2]
    d1 = abx * apx + aby * apy + abz * apz
    d2 = acx * apx + acy * apy + acz * apz
    bpx, bpy, bpz = p[0] - b[0], p[1] - b[1], p[2] - b[2]
    d3 = abx * bpx + aby * bpy + abz * bpz
    d4 = acx * bpx + acy * bpy + acz * bpz
    cpx, cpy, cpz = p[0] - c[0], p[1] - c[1], p[2] - c[2]
    d5 = abx * cpx + aby * cpy + abz * cpz
    d6 = acx * cpx + acy * cpy + acz * cpz
    va = d3 * d6 - d5 * d4
    vb = d5 * d2 - d1 * d6
    vc = d1 * d4 - d3 * d2
    if d1 <= 0 and d2 <= 0:
        s, t = 0.0, 0.0
    elif d3 >= 0 and d4 <= d3:
        s, t = 1.0, 0.0
    elif d6 >= 0 and d5 <= d6:
        s, t = 0.0, 1.0
    elif vc <= 0 and d1 >= 0 and d3 <= 0:
        s, t = d1 / (d1 - d3), 0.0
    elif vb <= 0 and d2 >= 0 and d6 <= 0:
        s, t = 0.0, d2 / (d2 - d6)
    elif va <= 0 and d4 - d3 >= 0 and d5 - d6 >= 0:
        t = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        s = 1.0 - t
    else:
        total = va + vb + vc
        if total <= 0.0:  # a triangle without area
            s, t = 0.0, 0.0
        else:
            s, t = vb / total, vc / total
    dx = apx - s * abx - t * acx
    dy = apy - s * aby - t * acy
    dz = apz - s * abz - t * acz
    return dx * dx + dy * dy + dz * dz
