"""Textures of one scene as mip pyramids in one flat array, the layout that the shading kernel reads."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from uavdepth.scenes.textures import VARIANTS, painted, texture_source


@dataclass(frozen=True)
class TextureAtlas:
    """Mip pyramids of T textures.

    Args:
        texels: (K,) uint32 of all levels of all textures, rows first; from the low byte on they are blue,
            green, red, gloss.
        start: (T,) int64 index of each texture's finest level in `texels`; coarser ones follow.
        levels: (T,) int32 number of levels; the finest has side 2 ** (levels - 1), the last is 1 x 1.
        per_metre: (T,) float32 repetitions per metre.
    """

    texels: NDArray[np.uint32]
    start: NDArray[np.int64]
    levels: NDArray[np.int32]
    per_metre: NDArray[np.float32]


def build_atlas(names: tuple[str, ...], seed: int) -> TextureAtlas:
    """Pyramids of the named textures in the variants that `seed` picks."""
    pyramids = []
    for number, name in enumerate(names):
        pyramids.append(_pyramid(name, (seed + number) % VARIANTS))
    sizes = [len(pyramid) for pyramid in pyramids]
    sides = [painted_side(size) for size in sizes]
    return TextureAtlas(
        np.concatenate(pyramids).view("<u4")[:, 0].astype(np.uint32, copy=False),
        np.cumsum([0, *sizes[:-1]]).astype(np.int64),
        np.array([side.bit_length() for side in sides], np.int32),
        np.array([1.0 / texture_source(name).size_m for name in names], np.float32),
    )


def painted_side(texels: int) -> int:
    """Side of the finest level of a pyramid of `texels` texels: 4/3 side**2 of them, rounded down."""
    return int((texels * 0.75) ** 0.5 + 0.5)


@lru_cache(maxsize=128)
def _pyramid(name: str, variant: int) -> NDArray[np.uint8]:
    """(K, 4) texels from the painted size down to 1 x 1, averaged in linear light."""
    picture = painted(name, variant).astype(np.float32)
    picture[..., :3] **= 2  # gamma 2 is close enough to sRGB, and its inverse is a square root
    parts = []
    while True:
        level = picture.copy()
        level[..., :3] = np.sqrt(level[..., :3])
        parts.append(np.rint(level).astype(np.uint8).reshape(-1, 4))
        side = picture.shape[0]
        if side == 1:
            return np.concatenate(parts)
        picture = picture.reshape(side // 2, 2, side // 2, 2, 4).mean(axis=(1, 3))
