"""Textures of one scene as mip pyramids, in the layout that the shading kernel reads."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from uavdepth.scenes.textures import TEXTURES, VARIANTS, painted, texture_source


@dataclass(frozen=True)
class TextureAtlas:
    """Mip pyramids of T textures. Scenes that share a texture share its memory.

    Args:
        pyramids: for each texture its texels as uint32, which from the low byte on are blue, green, red,
            gloss: the finest level row by row, then the coarser ones down to 1 x 1.
        address: (T,) int64, where each pyramid lies; valid as long as this object lives.
        levels: (T,) int32 number of levels; the finest has side 2 ** (levels - 1).
        per_metre: (T,) float32 repetitions per metre.
    """

    pyramids: tuple[NDArray[np.uint32], ...]
    address: NDArray[np.int64]
    levels: NDArray[np.int32]
    per_metre: NDArray[np.float32]


def build_atlas(names: tuple[str, ...], seed: int) -> TextureAtlas:
    """Pyramids of the named textures in the variants that `seed` picks."""
    pyramids = tuple(_pyramid(name, (seed + number) % VARIANTS) for number, name in enumerate(names))
    return TextureAtlas(
        pyramids,
        np.array([pyramid.ctypes.data for pyramid in pyramids], np.int64),
        np.array([_levels(len(pyramid)) for pyramid in pyramids], np.int32),
        np.array([1.0 / texture_source(name).size_m for name in names], np.float32),
    )


def _levels(texels: int) -> int:
    """Levels of a pyramid of `texels` texels, (4 ** levels - 1) / 3 of them."""
    return (3 * texels + 1).bit_length() // 2


@lru_cache(maxsize=len(TEXTURES) * VARIANTS)
def _pyramid(name: str, variant: int) -> NDArray[np.uint32]:
    """Texels from the painted size down to 1 x 1, averaged in linear light."""
    picture = painted(name, variant)
    parts = [picture.reshape(-1, 4)]
    linear = picture.astype(np.float32)
    linear[..., :3] **= 2  # gamma 2 is close enough to sRGB, and its inverse is a square root
    while linear.shape[0] > 1:
        rows = linear[0::2] + linear[1::2]
        linear = np.float32(0.25) * (rows[:, 0::2] + rows[:, 1::2])
        level = linear.copy()
        level[..., :3] = np.sqrt(level[..., :3])
        parts.append(np.rint(level).astype(np.uint8).reshape(-1, 4))
    texels = np.concatenate(parts).view("<u4")[:, 0].astype(np.uint32, copy=False)
    texels.flags.writeable = False
    return texels
