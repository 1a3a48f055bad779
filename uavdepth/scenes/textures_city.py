"""City textures."""
from __future__ import annotations

from uavdepth.scenes.description import TextureSource

CITY_TEXTURES: dict[str, TextureSource] = {}
