"""All textures of the rendered worlds by name, in a few painted variants each."""

from __future__ import annotations

import zlib

import numpy as np
from numpy.typing import NDArray

from uavdepth.errors import SceneError
from uavdepth.scenes.description import TextureSource
from uavdepth.scenes.textures_city import CITY_TEXTURES
from uavdepth.scenes.textures_nature import NATURE_TEXTURES
from uavdepth.scenes.textures_things import THING_TEXTURES

TEXTURES: dict[str, TextureSource] = CITY_TEXTURES | NATURE_TEXTURES | THING_TEXTURES

VARIANTS = 4
"""Differently painted versions of each texture; a scene's seed picks one. Bounds the cache's memory."""


def texture_source(name: str) -> TextureSource:
    """The named texture. Raises SceneError for a name that no set has."""
    try:
        return TEXTURES[name]
    except KeyError:
        raise SceneError(f"no texture is called {name!r}; known: {', '.join(sorted(TEXTURES))}") from None


def painted(name: str, variant: int) -> NDArray[np.uint8]:
    """(S, S, 4) uint8 BGR and gloss of one texture.

    Args:
        name: a name in `TEXTURES`.
        variant: which version; the same one is the same picture in every process.
    """
    source = texture_source(name)
    rng = np.random.default_rng([zlib.crc32(name.encode()), variant])
    picture = source.make(rng)
    side = picture.shape[0]
    if picture.shape[1] != side or side & (side - 1) or picture.shape[2] not in (3, 4):
        raise SceneError(f"texture {name!r} has shape {picture.shape}: (S, S, 3 or 4), S a power of two")
    if picture.shape[2] == 3:
        picture = np.concatenate([picture, np.zeros((side, side, 1), np.uint8)], axis=2)
    picture = np.ascontiguousarray(picture, np.uint8)
    picture.flags.writeable = False
    return picture
