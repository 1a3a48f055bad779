"""Filtered lookups in a `TextureAtlas`: bilinear, between mip levels, and along a pixel's footprint.

The four channels of a texel are weighted together: spread over the 16-bit lanes of one 64-bit integer, with
weights of 8 bits, as graphics hardware does it.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from llvmlite import ir  # type: ignore[import-untyped]
from numba import types
from numba.extending import intrinsic

from uavdepth.scenes.kernels import kernel

_MOST_SAMPLES = 8
"""Most texture samples along a pixel's footprint: surfaces seen more obliquely than 1:8 blur."""

_SHARPER = 0.3
"""Mip levels finer than the footprint asks for: trilinear filtering alone is softer than a lens."""

_LEAST_PART = 0.02
"""Weight of a coarser level below which it is not looked up."""

_POINT = 16
_ONE = 1 << _POINT
"""Places in a level are integers with 16 bits after the point."""

_BYTES = np.uint64(0x00FF00FF00FF00FF)
_HALVES = np.uint64(0x0000FFFF0000FFFF)
_TO_HIGH = np.uint64(24)
_ODD = np.uint64(16)
_LOW = np.uint64(0xFFFFFFFF)
_HIGH = np.uint64(32)


def _read(typingctx, address, number):  # type: ignore[no-untyped-def]
    """The uint32 of that number from an address on."""

    def generate(context, builder, _, values):  # type: ignore[no-untyped-def]
        first = builder.inttoptr(values[0], ir.IntType(32).as_pointer())
        return builder.load(builder.gep(first, [values[1]]))

    return types.uint32(types.intp, types.intp), generate


_texel: Any = intrinsic(_read)


@kernel
def _lanes(texels, at):  # type: ignore[no-untyped-def]
    """One texel's channels in 16-bit lanes, from low to high blue, red, green, gloss."""
    packed = np.uint64(_texel(texels, at))
    return (packed | (packed << _TO_HIGH)) & _BYTES


@kernel
def _bilinear(texels, base, shift, x, y):  # type: ignore[no-untyped-def]
    """256 times the texels around a place in the level that starts at `base` with side 2 ** shift.

    Args:
        x, y: the place in texels times `_ONE`; texel centres lie at halves.
    """
    mask = (1 << shift) - 1
    px = x - _ONE // 2
    py = y - _ONE // 2
    x0 = (px >> _POINT) & mask
    y0 = ((py >> _POINT) & mask) << shift
    x1 = (x0 + 1) & mask
    y1 = (y0 + (1 << shift)) & (mask << shift)
    ax = (px >> (_POINT - 8)) & 255
    ay = (py >> (_POINT - 8)) & 255
    both = (ax * ay + 128) >> 8
    return (
        _lanes(texels, base + y0 + x0) * np.uint64(256 - ax - ay + both)
        + _lanes(texels, base + y0 + x1) * np.uint64(ax - both)
        + _lanes(texels, base + y1 + x0) * np.uint64(ay - both)
        + _lanes(texels, base + y1 + x1) * np.uint64(both)
    )


@kernel
def _along(texels, base, shift, x, y, step_x, step_y, samples):  # type: ignore[no-untyped-def]
    """Sum of `_bilinear` over a row of places: blue and green, red and gloss, in 32-bit lanes."""
    even = np.uint64(0)
    odd = np.uint64(0)
    for _ in range(samples):
        lanes = _bilinear(texels, base, shift, x, y)
        even += lanes & _HALVES
        odd += (lanes >> _ODD) & _HALVES
        x += step_x
        y += step_y
    return even, odd


@kernel
def filtered(texels, levels, x, y, ax, ay, bx, by):  # type: ignore[no-untyped-def]
    """Texture averaged over the parallelogram of half axes a/2, b/2 around x, y (in repetitions).

    Samples are spread along the longer axis and each is filtered trilinearly with the shorter one, as
    graphics hardware does anisotropic filtering. Returns blue, green, red, gloss, 0 to 1.

    Args:
        texels, levels: address and number of levels of a pyramid in a `TextureAtlas`.
        x, y, ax, ay, bx, by: float32.
    """
    long = math.sqrt(ax * ax + ay * ay)
    short = math.sqrt(bx * bx + by * by)
    if short > long:
        long, short = short, long
        ax, ay = bx, by
    top = levels - 1
    side = float(1 << top)
    samples = 1
    if long * side > 1.0:
        samples = int(min(math.ceil(long / max(short, 1.0 / side)), _MOST_SAMPLES))
    footprint = max(long / samples, short) * side
    lod = min(max(math.log2(max(footprint, 1e-6)) - _SHARPER, 0.0), float(top))
    low = int(lod)
    part = np.float32(lod - low)

    shift = top - low
    base = ((1 << (2 * top)) - (1 << (2 * shift))) * 4 // 3
    scale = float(1 << (shift + _POINT))
    back = 0.5 / samples - 0.5
    px = int((x - math.floor(x) + ax * back) * scale)
    py = int((y - math.floor(y) + ay * back) * scale)
    step_x = int(ax / samples * scale)
    step_y = int(ay / samples * scale)
    even, odd = _along(texels, base, shift, px, py, step_x, step_y, samples)
    unit = np.float32(1.0 / (256.0 * 255.0)) / np.float32(samples)
    blue = np.float32(even & _LOW)
    green = np.float32(even >> _HIGH)
    red = np.float32(odd & _LOW)
    gloss = np.float32(odd >> _HIGH)
    if part > _LEAST_PART and shift > 0:
        even, odd = _along(
            texels, base + (1 << (2 * shift)), shift - 1, px >> 1, py >> 1, step_x >> 1, step_y >> 1, samples
        )
        blue += (np.float32(even & _LOW) - blue) * part
        green += (np.float32(even >> _HIGH) - green) * part
        red += (np.float32(odd & _LOW) - red) * part
        gloss += (np.float32(odd >> _HIGH) - gloss) * part
    return blue * unit, green * unit, red * unit, gloss * unit
