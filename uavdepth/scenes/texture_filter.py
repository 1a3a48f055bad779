"""Filtered lookups in a `TextureAtlas`: bilinear, between mip levels, and along a pixel's footprint."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from uavdepth.scenes.sky import FAST

_MOST_SAMPLES = 8
"""Most texture samples along a pixel's footprint: surfaces seen more obliquely than 1:8 blur."""

_SHARPER = 0.3
"""Mip levels finer than the footprint asks for: trilinear filtering alone is softer than a lens."""


@njit(cache=True, nogil=True, fastmath=FAST)
def _texel(texels, base, side, x, y):  # type: ignore[no-untyped-def]
    """Bilinear lookup in one level: x, y in repetitions. Returns blue, green, red, gloss, 0 to 255."""
    px = x * side - 0.5
    py = y * side - 0.5
    fx = math.floor(px)
    fy = math.floor(py)
    ax = np.float32(px - fx)
    ay = np.float32(py - fy)
    mask = side - 1
    x0 = int(fx) & mask
    y0 = int(fy) & mask
    x1 = (x0 + 1) & mask
    y1 = (y0 + 1) & mask
    p00 = texels[base + y0 * side + x0]
    p01 = texels[base + y0 * side + x1]
    p10 = texels[base + y1 * side + x0]
    p11 = texels[base + y1 * side + x1]
    one = np.float32(1.0)
    w00 = (one - ax) * (one - ay)
    w01 = ax * (one - ay)
    w10 = (one - ax) * ay
    w11 = ax * ay
    return (
        w00 * p00[0] + w01 * p01[0] + w10 * p10[0] + w11 * p11[0],
        w00 * p00[1] + w01 * p01[1] + w10 * p10[1] + w11 * p11[1],
        w00 * p00[2] + w01 * p01[2] + w10 * p10[2] + w11 * p11[2],
        w00 * p00[3] + w01 * p01[3] + w10 * p10[3] + w11 * p11[3],
    )


@njit(cache=True, nogil=True, fastmath=FAST)
def _level(texels, start, levels, level, x, y):  # type: ignore[no-untyped-def]
    """`_texel` at a mip level of a texture whose finest side is 2 ** (levels - 1)."""
    base = start
    side = 1 << (levels - 1)
    for _ in range(level):
        base += side * side
        side >>= 1
    return _texel(texels, base, side, x, y)


@njit(cache=True, nogil=True, fastmath=FAST)
def filtered(texels, start, levels, x, y, ax, ay, bx, by):  # type: ignore[no-untyped-def]
    """Texture averaged over the parallelogram of half axes a/2, b/2 around x, y (in repetitions).

    Samples are spread along the longer axis and each is filtered trilinearly with the shorter one, as
    graphics hardware does anisotropic filtering.
    """
    long = math.sqrt(ax * ax + ay * ay)
    short = math.sqrt(bx * bx + by * by)
    if short > long:
        long, short = short, long
        ax, ay = bx, by
    side = float(1 << (levels - 1))
    samples = 1
    if long * side > 1.0:
        samples = int(min(math.ceil(long / max(short, 1.0 / side)), _MOST_SAMPLES))
    footprint = max(long / samples, short) * side
    lod = min(max(math.log2(max(footprint, 1e-6)) - _SHARPER, 0.0), levels - 1.0)
    low = int(lod)
    part = np.float32(lod - low)
    blue = np.float32(0.0)
    green = np.float32(0.0)
    red = np.float32(0.0)
    gloss = np.float32(0.0)
    for k in range(samples):
        step = (k + 0.5) / samples - 0.5
        sx = x + ax * step
        sy = y + ay * step
        b, g, r, s = _level(texels, start, levels, low, sx, sy)
        if part > 0.02 and low < levels - 1:
            b2, g2, r2, s2 = _level(texels, start, levels, low + 1, sx, sy)
            b += (b2 - b) * part
            g += (g2 - g) * part
            r += (r2 - r) * part
            s += (s2 - s) * part
        blue += b
        green += g
        red += r
        gloss += s
    scale = np.float32(1.0 / (255.0 * samples))
    return blue * scale, green * scale, red * scale, gloss * scale
