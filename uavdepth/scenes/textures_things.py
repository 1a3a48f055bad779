"""Textures of clothes, boards and nets."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from uavdepth.scenes.description import TextureSource
from uavdepth.scenes.painting import finish, fractal_noise, plain, ramp, smooth_noise

_SIZE = 256


def _fabric(rng: np.random.Generator) -> NDArray[np.uint8]:
    """Woven cloth with folds, striped in some variants; nearly white, so that the tint is its colour."""
    folds = fractal_noise(rng, _SIZE, (4, 7), 3)
    picture = plain(_SIZE, (200, 200, 200)) * (1.0 + 0.1 * folds)[..., None]
    stripes = 1.0 + rng.choice([0.0, 0.12, 0.3]) * np.sin(np.arange(_SIZE) * 2 * np.pi * 8 / _SIZE)
    return finish(np.asarray(picture * stripes[:, None, None], np.float32), rng, 6.0, 0.02)


def _denim(rng: np.random.Generator) -> NDArray[np.uint8]:
    folds = fractal_noise(rng, _SIZE, (9, 4), 4)
    return finish(ramp(folds, [-2, 2], [(150, 150, 150), (225, 225, 225)]), rng, 9.0, 0.02)


def _skin(rng: np.random.Generator) -> NDArray[np.uint8]:
    tone = smooth_noise(rng, _SIZE, 5)
    return finish(ramp(tone, [-2, 2], [(205, 205, 208), (235, 235, 235)]), rng, 3.0, 0.0)


def _planks(rng: np.random.Generator) -> NDArray[np.uint8]:
    """Upright weathered boards of 15 cm."""
    grain = fractal_noise(rng, _SIZE, (3, 60), 3)
    color = np.array([(92, 122, 152), (70, 96, 128), (120, 130, 138), (60, 70, 88)][int(rng.integers(4))])
    boards = 10
    place = np.arange(_SIZE) * boards / _SIZE
    shade = rng.uniform(0.75, 1.15, boards)[place.astype(int)] * np.where(place % 1.0 < 0.07, 0.35, 1.0)
    picture = color * ((1.0 + 0.14 * grain) * shade[None, :])[..., None]
    return finish(np.asarray(picture, np.float32), rng, 6.0, 0.05)


THING_TEXTURES: dict[str, TextureSource] = {
    "fabric": TextureSource(_fabric, 1.0, vertical=True),
    "denim": TextureSource(_denim, 1.0, vertical=True),
    "skin": TextureSource(_skin, 0.5),
    "planks": TextureSource(_planks, 1.5, vertical=True),
}
