"""The sky as a colour by direction: gradient, sun, clouds. Linear light, before gamma."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from uavdepth.scenes.description import SceneDescription
from uavdepth.scenes.kernels import kernel
from uavdepth.scenes.noise import cloud_noise

CLOUD_SIDE = 512
_CLOUD_SCALE = 0.11
"""Cloud tiles per unit of (horizontal / up) direction: how large clouds look."""


def cloud_map(seed: int) -> NDArray[np.float32]:
    """(CLOUD_SIDE, CLOUD_SIDE) tileable cloud thickness, uniformly distributed in 0 to 1."""
    noise = cloud_noise(np.random.default_rng([seed, 7]), CLOUD_SIDE, slope=1.75, coarsest=2.0)
    rank = np.empty(noise.size, np.float32)
    rank[np.argsort(noise, axis=None, kind="stable")] = np.linspace(0.0, 1.0, noise.size, dtype=np.float32)
    return rank.reshape(noise.shape)


def light_table(description: SceneDescription) -> NDArray[np.float32]:
    """(6, 3) float32 rows: sun direction NED, sun, ambient, sky top, sky horizon, (cloud, haze, 0).

    Colours of the sky are squared into linear light here, as textures are when they are read.
    """
    table = np.zeros((6, 3), np.float32)
    direction = np.asarray(description.sun_direction_ned, np.float64)
    table[0] = direction / np.linalg.norm(direction)
    table[1] = description.sun_bgr
    table[2] = description.ambient_bgr
    table[3] = np.square(description.sky_top_bgr)
    table[4] = np.square(description.sky_horizon_bgr)
    table[5] = (description.cloud_amount, description.haze_per_m, 0.0)
    return table


@kernel
def wrapped_bilinear(field, x, y):  # type: ignore[no-untyped-def]
    """Value of a tileable square float32 field (side a power of two) at float32 x, y in pixels."""
    mask = field.shape[0] - 1
    fx = math.floor(x)
    fy = math.floor(y)
    ax = np.float32(x - fx)
    ay = np.float32(y - fy)
    x0 = fx & mask
    y0 = fy & mask
    x1 = (x0 + 1) & mask
    y1 = (y0 + 1) & mask
    top = field[y0, x0] + (field[y0, x1] - field[y0, x0]) * ax
    bottom = field[y1, x0] + (field[y1, x1] - field[y1, x0]) * ax
    return top + (bottom - top) * ay


@kernel
def sky_color(dn, de, dd, light, clouds):  # type: ignore[no-untyped-def]
    """Linear blue, green, red of the sky along a unit NED direction.

    Args:
        dn, de, dd: the direction, float32.
        light: `light_table`.
        clouds: `cloud_map`.
    """
    up = max(-dd, 0.0)
    towards_sun = max(dn * light[0, 0] + de * light[0, 1] + dd * light[0, 2], 0.0)
    blend = math.sqrt(up)
    glow = 0.35 * towards_sun**12 + 0.5 * towards_sun**120
    disc = 6.0 if towards_sun > 0.99985 else 0.0
    amount = light[5, 0]
    cover = 0.0
    thick = 0.0
    if up > 0.015 and amount > 0.0:
        reach = _CLOUD_SCALE * CLOUD_SIDE / (up + 0.12)
        thickness = wrapped_bilinear(clouds, np.float32(dn * reach + 37.0), np.float32(de * reach + 11.0))
        edge = 1.0 - amount
        cover = min(max((thickness - edge) / 0.28, 0.0), 1.0)
        cover = cover * cover * (3.0 - 2.0 * cover) * min((up - 0.015) * 12.0, 1.0)
        thick = min(max((thickness - edge - 0.15) / 0.6, 0.0), 1.0)
    dim = 1.0 - 0.9 * cover
    white = 0.86 - 0.38 * thick + 0.25 * glow
    blue = light[4, 0] + (light[3, 0] - light[4, 0]) * blend + (glow * 0.55 + disc) * dim
    green = light[4, 1] + (light[3, 1] - light[4, 1]) * blend + (glow * 0.80 + disc) * dim
    red = light[4, 2] + (light[3, 2] - light[4, 2]) * blend + (glow + disc) * dim
    keep = 1.0 - 0.92 * cover
    paint = 0.92 * cover * white
    tone = 0.35
    return (
        np.float32(blue * keep + paint * (tone * light[4, 0] + 1.0 - tone)),
        np.float32(green * keep + paint * (tone * light[4, 1] + 1.0 - tone)),
        np.float32(red * keep + paint * (tone * light[4, 2] + 1.0 - tone)),
    )
