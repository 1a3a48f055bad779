"""Exact distance from a point to the nearest triangle."""

from __future__ import annotations

import math

from numba import njit


@njit(cache=True, nogil=True)
def nearest_surface(point, vertices, faces, low, high, limit):  # type: ignore[no-untyped-def]
    """Distance in metres from `point` to the nearest triangle, or `limit` when none is nearer.

    Args:
        point: (3,) float64 NED.
        vertices: (N, 3) float32. faces: (M, 3) int32.
        low, high: (M, 3) float32 corners of each triangle's bounding box.
        limit: metres.

    Distance to a triangle after Ericson, Real-Time Collision Detection (2005), section 5.1.5.
    """
    best = limit * limit
    for f in range(len(faces)):
        away = 0.0
        for axis in range(3):
            gap = max(low[f, axis] - point[axis], point[axis] - high[f, axis], 0.0)
            away += gap * gap
        if away < best:
            best = min(
                best, _squared(point, vertices[faces[f, 0]], vertices[faces[f, 1]], vertices[faces[f, 2]])
            )
    return math.sqrt(best)


@njit(cache=True, nogil=True)
def _squared(p, a, b, c):  # type: ignore[no-untyped-def]
    """Squared distance from p to triangle a, b, c."""
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
