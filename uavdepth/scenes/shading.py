"""Colour of ray hits: texture, sun, sky light, haze. Numba kernels on flat arrays, one thread, no GIL."""

from __future__ import annotations

import math

import numpy as np

from uavdepth.scenes.face_table import NORMAL, SMOOTH, TEXTURE, TINT, U, V
from uavdepth.scenes.kernels import kernel
from uavdepth.scenes.sky import sky_color, wrapped_bilinear
from uavdepth.scenes.texture_filter import filtered

_MACRO_TILE_M = 48.0
"""Metres that one tile of the macro variation spans; it hides the repetition of the textures."""

_MACRO_CONTRAST = np.float32(0.13)
_LEAN_NORTH, _LEAN_EAST = np.float32(0.6), np.float32(0.8)
"""How far the macro variation moves along per metre of height, so that walls have it too."""

_LEAST_FACING = np.float32(0.04)
"""Cosine below which a surface's footprint grows no further."""

_SQUARE_ON = np.float32(1e-4)
_SQRT_2 = np.float32(math.sqrt(2.0))

_SKY_AT_SIDE, _SKY_TURN = np.float32(0.72), np.float32(0.28)
"""Share of the sky's light on an upright surface, and how much more one that faces up gets."""

_LEAST_GLOSS = np.float32(0.03)
_MIRROR_AHEAD, _MIRROR_ALONG = np.float32(0.12), np.float32(0.75)
"""What gloss 1 reflects when looked at squarely, and how much more along the surface (Schlick, 1994)."""

_LOWEST_MIRRORED = np.float32(-0.02)
"""Mirrors show the sky only, not what stands before them."""


@kernel
def surfaces(origin, directions, order, face, u, v, t, table, corners, vertex_normals, sun):  # type: ignore[no-untyped-def]
    """Normals and textures of the hits, and the rays from them towards the sun.

    Args:
        origin: (3,) NED. directions: (N, 3) rays. order: (N,) sequence of the rays. face, u, v, t: hits.
        table: (M, 16) from `build_face_table`. corners: (M, 3) vertex numbers. vertex_normals: (V, 3).
        sun: (3,) direction towards the sun.

    Returns:
        (N, 3) float32 unit normals turned towards the viewer, 0 where a ray misses; (N,) int32 texture
        numbers, -1 where a ray misses; (K,) int64 numbers of the hits that face the sun, in `order`; and
        (K, 3) float32 start points of their shadow rays, lifted off the surface by a little more than the
        error of float32 there.
    """
    normals = np.zeros((len(face), 3), np.float32)
    texture = np.empty(len(face), np.int32)
    which = np.empty(len(face), np.int64)
    points = np.empty((len(face), 3), np.float32)
    count = 0
    for i in order:
        f = face[i]
        if f < 0:
            texture[i] = -1
            continue
        row = table[f]
        texture[i] = int(row[TEXTURE])
        fx = row[NORMAL]
        fy = row[NORMAL + 1]
        fz = row[NORMAL + 2]
        dx = directions[i, 0]
        dy = directions[i, 1]
        dz = directions[i, 2]
        x = fx
        y = fy
        z = fz
        if row[SMOOTH] != 0.0:
            a = corners[f, 0]
            b = corners[f, 1]
            c = corners[f, 2]
            wb = u[i]
            wc = v[i]
            wa = np.float32(1.0) - wb - wc
            x = wa * vertex_normals[a, 0] + wb * vertex_normals[b, 0] + wc * vertex_normals[c, 0]
            y = wa * vertex_normals[a, 1] + wb * vertex_normals[b, 1] + wc * vertex_normals[c, 1]
            z = wa * vertex_normals[a, 2] + wb * vertex_normals[b, 2] + wc * vertex_normals[c, 2]
            length = math.sqrt(x * x + y * y + z * z) + np.float32(1e-20)
            x /= length
            y /= length
            z /= length
        if x * dx + y * dy + z * dz > 0:
            x = -x
            y = -y
            z = -z
        normals[i, 0] = x
        normals[i, 1] = y
        normals[i, 2] = z
        if x * sun[0] + y * sun[1] + z * sun[2] <= 0.0:
            continue
        lift = np.float32(0.004) + np.float32(2e-5) * t[i]
        if fx * dx + fy * dy + fz * dz > 0:
            lift = -lift
        points[count, 0] = origin[0] + t[i] * dx + lift * fx
        points[count, 1] = origin[1] + t[i] * dy + lift * fy
        points[count, 2] = origin[2] + t[i] * dz + lift * fz
        which[count] = i
        count += 1
    return normals, texture, which[:count], points[:count]


@kernel
def shade(  # type: ignore[no-untyped-def]
    origin, directions, face, t, normals, lit, pixel, table, texels, levels, light, clouds, macro
):
    """(N, 3) float32 linear colour of each ray.

    Args:
        origin: (3,) NED. directions: (N, 3), length such that t is depth. face, t: hits.
        normals: from `surfaces`. lit: (N,) whether the sun reaches the hit.
        pixel: angle of a pixel in radians.
        table: (M, 16) from `build_face_table`. texels, levels: address and levels of a
            `TextureAtlas`.
        light, clouds, macro: `light_table`, `cloud_map`, tileable brightness variation.
    """
    out = np.empty((len(face), 3), np.float32)
    zero = np.float32(0.0)
    one = np.float32(1.0)
    two = np.float32(2.0)
    haze = light[5, 1]
    macro_scale = np.float32(macro.shape[0] / _MACRO_TILE_M)
    pixel_rad = np.float32(pixel)
    for i in range(len(face)):
        dn = directions[i, 0]
        de = directions[i, 1]
        dd = directions[i, 2]
        norm = math.sqrt(dn * dn + de * de + dd * dd)
        dn /= norm
        de /= norm
        dd /= norm
        blue = green = red = through = zero
        # The sky is a mirror that shows all of what lies straight ahead.
        mirror = one
        mn = dn
        me = de
        md = dd
        f = face[i]
        if f >= 0:
            nx = normals[i, 0]
            ny = normals[i, 1]
            nz = normals[i, 2]
            distance = t[i] * norm
            facing = -(dn * nx + de * ny + dd * nz)
            width = t[i] * pixel_rad
            # Footprint of the pixel on the surface: `width` across the view, stretched along it.
            sx = dn + facing * nx
            sy = de + facing * ny
            sz = dd + facing * nz
            slope = np.float32(math.sqrt(sx * sx + sy * sy + sz * sz))
            if slope < _SQUARE_ON:
                sx = ny - nz
                sy = nz - nx
                sz = nx - ny
                slope = _SQRT_2
            stretch = width / (max(facing, _LEAST_FACING) * slope)
            cross = width / slope
            bx = (ny * sz - nz * sy) * cross
            by = (nz * sx - nx * sz) * cross
            bz = (nx * sy - ny * sx) * cross
            g = table[f]
            au = (g[U] * sx + g[U + 1] * sy + g[U + 2] * sz) * stretch
            av = (g[V] * sx + g[V + 1] * sy + g[V + 2] * sz) * stretch
            bu = g[U] * bx + g[U + 1] * by + g[U + 2] * bz
            bv = g[V] * bx + g[V + 1] * by + g[V + 2] * bz
            pn = origin[0] + distance * dn
            pe = origin[1] + distance * de
            pd = origin[2] + distance * dd
            x = g[U] * pn + g[U + 1] * pe + g[U + 2] * pd + g[U + 3]
            y = g[V] * pn + g[V + 1] * pe + g[V + 2] * pd + g[V + 3]
            k = int(g[TEXTURE])
            blue, green, red, gloss = filtered(texels[k], levels[k], x, y, au, av, bu, bv)

            vary = one + _MACRO_CONTRAST * wrapped_bilinear(
                macro, (pn + _LEAN_NORTH * pd) * macro_scale, (pe + _LEAN_EAST * pd) * macro_scale
            )
            sun = (
                vary * max(nx * light[0, 0] + ny * light[0, 1] + nz * light[0, 2], zero) * np.float32(lit[i])
            )
            sky = vary * (_SKY_AT_SIDE - _SKY_TURN * nz)
            blue *= blue * g[TINT] * (sun * light[1, 0] + sky * light[2, 0])
            green *= green * g[TINT + 1] * (sun * light[1, 1] + sky * light[2, 1])
            red *= red * g[TINT + 2] * (sun * light[1, 2] + sky * light[2, 2])
            through = np.float32(math.exp(-haze * distance))
            mirror = zero
            if gloss > _LEAST_GLOSS:
                rough = one - max(facing, zero)
                rough *= rough
                mirror = gloss * (_MIRROR_AHEAD + _MIRROR_ALONG * rough * rough)
                mn = dn + two * facing * nx
                me = de + two * facing * ny
                md = min(dd + two * facing * nz, _LOWEST_MIRRORED)
        if mirror > zero:
            mb, mg, mr = sky_color(mn, me, md, light, clouds)
            if f < 0:
                out[i, 0] = mb
                out[i, 1] = mg
                out[i, 2] = mr
                continue
            blue += (min(mb, two) - blue) * mirror
            green += (min(mg, two) - green) * mirror
            red += (min(mr, two) - red) * mirror
        out[i, 0] = blue * through + light[4, 0] * (one - through)
        out[i, 1] = green * through + light[4, 1] * (one - through)
        out[i, 2] = red * through + light[4, 2] * (one - through)
    return out


@kernel
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
