"""Colour of ray hits: texture, sun, sky light, haze. Numba kernels on flat arrays, one thread, no GIL.

Numba's cache on disk watches this file only: after a change in `sky` or `texture_filter`, touch it.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from uavdepth.scenes.sky import FAST, sky_color, wrapped_bilinear
from uavdepth.scenes.texture_filter import filtered

_MACRO_TILE_M = 48.0
"""Metres that one tile of the macro variation spans; it hides the repetition of the textures."""


@njit(cache=True, nogil=True, fastmath=FAST)
def surface_normals(directions, face, u, v, corners, flat_normals, vertex_normals, smooth):  # type: ignore[no-untyped-def]
    """(N, 3) float32 unit normals of the hits, turned towards the viewer; 0 where a ray misses.

    Args:
        directions: (N, 3) rays. face, u, v: their hits.
        corners: (M, 3) vertex numbers. flat_normals: (M, 3). vertex_normals: (V, 3). smooth: (M,).
    """
    normals = np.zeros((len(face), 3), np.float32)
    for i in range(len(face)):
        f = face[i]
        if f < 0:
            continue
        x = flat_normals[f, 0]
        y = flat_normals[f, 1]
        z = flat_normals[f, 2]
        d = directions[i]
        if smooth[f]:
            a = corners[f, 0]
            b = corners[f, 1]
            c = corners[f, 2]
            wb = u[i]
            wc = v[i]
            wa = np.float32(1.0) - wb - wc
            x = wa * vertex_normals[a, 0] + wb * vertex_normals[b, 0] + wc * vertex_normals[c, 0]
            y = wa * vertex_normals[a, 1] + wb * vertex_normals[b, 1] + wc * vertex_normals[c, 1]
            z = wa * vertex_normals[a, 2] + wb * vertex_normals[b, 2] + wc * vertex_normals[c, 2]
            length = math.sqrt(x * x + y * y + z * z) + 1e-20
            x /= length
            y /= length
            z /= length
        if x * d[0] + y * d[1] + z * d[2] > 0:
            x = -x
            y = -y
            z = -z
        normals[i, 0] = x
        normals[i, 1] = y
        normals[i, 2] = z
    return normals


@njit(cache=True, nogil=True, fastmath=FAST)
def shadow_rays(origin, directions, face, t, normals, flat_normals, sun):  # type: ignore[no-untyped-def]
    """Start points of the rays towards the sun, for hits that face it.

    Returns:
        (K,) int64 numbers of those hits, and (K, 3) float32 points lifted off the surface by a little
        more than the error of float32 there.
    """
    which = np.empty(len(face), np.int64)
    points = np.empty((len(face), 3), np.float32)
    count = 0
    for i in range(len(face)):
        f = face[i]
        if f < 0:
            continue
        if normals[i, 0] * sun[0] + normals[i, 1] * sun[1] + normals[i, 2] * sun[2] <= 0.0:
            continue
        d = directions[i]
        side = flat_normals[f, 0] * d[0] + flat_normals[f, 1] * d[1] + flat_normals[f, 2] * d[2]
        lift = 0.004 + 2e-5 * t[i]
        if side > 0:
            lift = -lift
        for axis in range(3):
            points[count, axis] = origin[axis] + t[i] * d[axis] + lift * flat_normals[f, axis]
        which[count] = i
        count += 1
    return which[:count], points[:count]


@njit(cache=True, nogil=True, fastmath=FAST)
def shade(  # type: ignore[no-untyped-def]
    origin,
    directions,
    face,
    u,
    v,
    t,
    normals,
    lit,
    pixel,
    uv,
    uv_gradient,
    texture,
    tint,
    texels,
    start,
    levels,
    per_metre,
    light,
    clouds,
    macro,
):
    """(N, 3) float32 linear colour of each ray.

    Args:
        origin: (3,) NED. directions: (N, 3), length such that t is depth. face, u, v, t: hits.
        normals: from `surface_normals`. lit: (N,) share of the sun that reaches the hit.
        pixel: angle of a pixel in radians.
        uv, uv_gradient: (M, 3, 2) corners in metres, (M, 2, 3) change of uv per metre along NED.
        texture, tint: (M,), (M, 3). texels, start, levels, per_metre: a `TextureAtlas`.
        light, clouds, macro: `light_table`, `cloud_map`, tileable brightness variation.
    """
    out = np.empty((len(face), 3), np.float32)
    haze = light[5, 1]
    macro_scale = macro.shape[0] / _MACRO_TILE_M
    for i in range(len(face)):
        d = directions[i]
        norm = math.sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
        dn = d[0] / norm
        de = d[1] / norm
        dd = d[2] / norm
        f = face[i]
        if f < 0:
            out[i, 0], out[i, 1], out[i, 2] = sky_color(dn, de, dd, light, clouds)
            continue
        nx = normals[i, 0]
        ny = normals[i, 1]
        nz = normals[i, 2]
        distance = t[i] * norm
        facing = -(dn * nx + de * ny + dd * nz)
        width = t[i] * pixel
        # Footprint of the pixel on the surface: `width` across the view, stretched along it.
        sx = dn + facing * nx
        sy = de + facing * ny
        sz = dd + facing * nz
        slope = math.sqrt(sx * sx + sy * sy + sz * sz)
        if slope < 1e-4:
            sx, sy, sz, slope = ny - nz, nz - nx, nx - ny, math.sqrt(2.0)
        stretch = width / (max(facing, 0.04) * slope)
        cross = width / slope
        bx = (ny * sz - nz * sy) * cross
        by = (nz * sx - nx * sz) * cross
        bz = (nx * sy - ny * sx) * cross
        k = texture[f]
        rep = per_metre[k]
        g = uv_gradient[f]
        au = (g[0, 0] * sx + g[0, 1] * sy + g[0, 2] * sz) * stretch * rep
        av = (g[1, 0] * sx + g[1, 1] * sy + g[1, 2] * sz) * stretch * rep
        bu = (g[0, 0] * bx + g[0, 1] * by + g[0, 2] * bz) * rep
        bv = (g[1, 0] * bx + g[1, 1] * by + g[1, 2] * bz) * rep
        wa = np.float32(1.0) - u[i] - v[i]
        x = (wa * uv[f, 0, 0] + u[i] * uv[f, 1, 0] + v[i] * uv[f, 2, 0]) * rep
        y = (wa * uv[f, 0, 1] + u[i] * uv[f, 1, 1] + v[i] * uv[f, 2, 1]) * rep
        blue, green, red, gloss = filtered(texels, start[k], levels[k], x, y, au, av, bu, bv)

        pn = origin[0] + t[i] * d[0]
        pe = origin[1] + t[i] * d[1]
        pd = origin[2] + t[i] * d[2]
        vary = 1.0 + 0.13 * wrapped_bilinear(
            macro, (pn + 0.6 * pd) * macro_scale, (pe + 0.8 * pd) * macro_scale
        )
        sun = max(nx * light[0, 0] + ny * light[0, 1] + nz * light[0, 2], 0.0) * lit[i]
        sky = 0.72 - 0.28 * nz
        through = math.exp(-haze * distance)
        mirror = 0.0
        mb = mg = mr = 0.0
        if gloss > 0.03:
            rough = 1.0 - max(facing, 0.0)
            mirror = gloss * (0.12 + 0.75 * rough * rough * rough * rough)
            mb, mg, mr = sky_color(
                dn + 2.0 * facing * nx,
                de + 2.0 * facing * ny,
                min(dd + 2.0 * facing * nz, -0.02),
                light,
                clouds,
            )
        b = blue * blue * tint[f, 0] * vary * (sun * light[1, 0] + sky * light[2, 0])
        gr = green * green * tint[f, 1] * vary * (sun * light[1, 1] + sky * light[2, 1])
        r = red * red * tint[f, 2] * vary * (sun * light[1, 2] + sky * light[2, 2])
        b += (min(mb, 2.0) - b) * mirror
        gr += (min(mg, 2.0) - gr) * mirror
        r += (min(mr, 2.0) - r) * mirror
        out[i, 0] = b * through + light[4, 0] * (1.0 - through)
        out[i, 1] = gr * through + light[4, 1] * (1.0 - through)
        out[i, 2] = r * through + light[4, 2] * (1.0 - through)
    return out


@njit(cache=True, nogil=True, fastmath=FAST)
def edge_pixels(height, width, face, t, normals, lit, texture):  # type: ignore[no-untyped-def]
    """(K,) int64 numbers of the pixels whose right or lower neighbour shows another surface, and those
    neighbours: the ones that need more than one sample."""
    marked = np.zeros(height * width, np.bool_)
    for row in range(height):
        for column in range(width):
            i = row * width + column
            for other in range(2):
                if other == 0:
                    if column + 1 == width:
                        continue
                    j = i + 1
                else:
                    if row + 1 == height:
                        continue
                    j = i + width
                if face[i] == face[j]:
                    differs = lit[i] != lit[j]
                elif face[i] < 0 or face[j] < 0:
                    differs = True
                else:
                    along = (
                        normals[i, 0] * normals[j, 0]
                        + normals[i, 1] * normals[j, 1]
                        + normals[i, 2] * normals[j, 2]
                    )
                    step = abs(t[i] - t[j]) / min(t[i], t[j])
                    differs = (
                        along < 0.9
                        or texture[face[i]] != texture[face[j]]
                        or lit[i] != lit[j]
                        or (step > 0.05 and along < 0.999)
                        or step > 0.5
                    )
                if differs:
                    marked[i] = True
                    marked[j] = True
    return np.flatnonzero(marked)


@njit(cache=True, nogil=True, fastmath=FAST)
def develop(linear, exposure):  # type: ignore[no-untyped-def]
    """(N, 3) uint8 picture of linear light: exposure, a soft shoulder above 0.8, gamma 2."""
    out = np.empty(linear.shape, np.uint8)
    for i in range(linear.shape[0]):
        for c in range(3):
            x = max(linear[i, c] * exposure, 0.0)
            if x > 0.64:
                x = 0.64 + 0.36 * (1.0 - math.exp(-(x - 0.64) / 0.36))
            out[i, c] = int(min(255.0 * math.sqrt(x) + 0.5, 255.0))
    return out
