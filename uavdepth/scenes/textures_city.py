"""Textures of streets: asphalt, paving, concrete, roofs, metal, paint; with the house fronts' set."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from uavdepth.scenes.description import TextureSource
from uavdepth.scenes.painting import blend, cracks, finish, fractal_noise, plain, ramp, smooth_noise
from uavdepth.scenes.textures_facade import FACADE_TEXTURES

_SIZE = 512


def _asphalt(rng: np.random.Generator) -> NDArray[np.uint8]:
    """Rolled asphalt with patches, stains and cracks."""
    stones = rng.standard_normal((_SIZE, _SIZE)).astype(np.float32)
    stones = np.asarray(cv2.GaussianBlur(stones, (3, 3), 0.8, borderType=cv2.BORDER_REFLECT_101), np.float32)
    wear = fractal_noise(rng, _SIZE, 3, 5)
    picture = ramp(wear, [-2, 0, 2], [(66, 66, 66), (86, 85, 84), (112, 112, 110)])
    picture *= (1.0 + 0.22 * stones)[..., None]
    for _ in range(int(rng.integers(1, 4))):
        x, y = rng.integers(0, _SIZE - 160, 2)
        width, height = rng.integers(50, 160, 2)
        picture[y : y + height, x : x + width] *= rng.uniform(0.62, 0.85)
    picture = blend(picture, (34, 36, 38), 0.8 * cracks(rng, _SIZE, 7))
    stains = np.clip(smooth_noise(rng, _SIZE, 7) - 1.5, 0, 1)
    return finish(blend(picture, (38, 38, 40), 0.7 * stains), rng, 6.0, 0.03)


def _paving(rng: np.random.Generator) -> NDArray[np.uint8]:
    """Slabs of half a metre in two-thirds bond."""
    picture = ramp(fractal_noise(rng, _SIZE, 6, 5), [-2, 2], [(124, 130, 134), (170, 174, 178)])
    slabs = 6
    side = _SIZE / slabs
    joints = np.zeros((_SIZE, _SIZE), np.float32)
    for row in range(slabs):
        top = int(row * side)
        joints[top : top + 3] = 1.0
        for column in range(slabs):
            left = int(((column + 0.5 * (row % 2)) * side) % _SIZE)
            joints[top : int((row + 1) * side), left : left + 3] = 1.0
            end = int((row + 1) * side)
            shade = rng.uniform(0.84, 1.12)
            columns = np.arange(left, left + int(side) + 1) % _SIZE
            picture[top:end, columns] *= shade
    return finish(blend(picture, (70, 76, 80), 0.8 * joints), rng, 6.0, 0.04)


def _cobbles(rng: np.random.Generator) -> NDArray[np.uint8]:
    """Cut stones of about 12 cm."""
    picture = plain(_SIZE, (52, 54, 56))
    rows = 24
    side = _SIZE / rows
    for row in range(rows):
        left = rng.uniform(0, side)
        for column in range(rows):
            x = left + column * side
            shade = rng.uniform(0.75, 1.15)
            color = tuple(float(v) * shade for v in (118, 122, 128))
            for shift in (0, -_SIZE):
                a = (int(x + shift + 1.5), int(row * side + 1.5))
                b = (int(x + shift + side - 2), int((row + 1) * side - 2))
                cv2.rectangle(picture, a, b, color, -1)
    picture *= (1.0 + 0.1 * fractal_noise(rng, _SIZE, 20, 3))[..., None]
    return finish(picture, rng, 8.0, 0.05)


def _concrete(rng: np.random.Generator) -> NDArray[np.uint8]:
    """Cast panels of two metres with tie holes, streaks and blotches."""
    streaks = fractal_noise(rng, _SIZE, (3, 40), 3)
    blotches = fractal_noise(rng, _SIZE, 4, 6)
    tone = 0.5 * streaks + blotches
    picture = ramp(tone, [-2.5, 0, 2.5], [(112, 116, 118), (150, 154, 156), (182, 184, 186)])
    half = _SIZE // 2
    for line in (0, half):
        picture[line : line + 4] *= 0.55
        picture[:, line : line + 4] *= 0.55
    for y in (64, 192, 320, 448):
        for x in (64, 192, 320, 448):
            cv2.circle(picture, (x, y), 4, (70.0, 72.0, 74.0), -1, cv2.LINE_AA)
    return finish(blend(picture, (80, 84, 86), 0.5 * cracks(rng, _SIZE, 2)), rng, 5.0, 0.04)


def _roof_tiles(rng: np.random.Generator) -> NDArray[np.uint8]:
    """Pantiles of 20 x 33 cm."""
    color = np.array([(64, 84, 170), (72, 80, 96), (60, 70, 130)][int(rng.integers(3))], np.float32)
    rows, columns = 9, 15
    y, x = np.indices((_SIZE, _SIZE), dtype=np.float32)
    wave = 0.5 + 0.5 * np.cos(x * 2 * np.pi * columns / _SIZE)
    course = (y * rows / _SIZE) % 1.0
    tone = 0.7 + 0.3 * wave - 0.35 * (course > 0.88)
    patches = rng.uniform(0.8, 1.15, (rows, columns)).astype(np.float32)
    spread = cv2.resize(patches, (_SIZE, _SIZE), interpolation=cv2.INTER_NEAREST)
    return finish(color * (tone * spread)[..., None], rng, 6.0, 0.05)


def _corrugated(rng: np.random.Generator) -> NDArray[np.uint8]:
    """Painted trapezoidal sheet with rust and screws."""
    color = np.array([(150, 130, 90), (120, 150, 110), (170, 172, 174), (90, 100, 170)][int(rng.integers(4))])
    x = np.arange(_SIZE, dtype=np.float32)
    ribs = np.clip(2.2 * np.sin(x * 2 * np.pi * 16 / _SIZE), -1, 1)
    picture = np.asarray(plain(_SIZE, tuple(color)) * (1.0 + 0.16 * ribs)[None, :, None], np.float32)
    rust = np.clip(fractal_noise(rng, _SIZE, (3, 14), 5) - 0.9, 0, 1)
    picture = blend(picture, (48, 76, 120), 0.9 * rust)
    for y in range(20, _SIZE, 128):
        for column in range(16):
            cv2.circle(picture, (column * 32 + 8, y), 3, (60.0, 60.0, 64.0), -1, cv2.LINE_AA)
    picture[:3] *= 0.5
    return finish(picture, rng, 5.0, 0.05)


def _paint(rng: np.random.Generator) -> NDArray[np.uint8]:
    """Painted metal: nearly white, so that the tint is its colour."""
    picture = plain(_SIZE, (205, 205, 205)) * (1.0 + 0.06 * fractal_noise(rng, _SIZE, 4, 5))[..., None]
    return finish(picture, rng, 4.0, 0.0)


def _marking(rng: np.random.Generator) -> NDArray[np.uint8]:
    """Worn white road paint."""
    worn = np.clip(fractal_noise(rng, _SIZE, 12, 4) - 0.7, 0, 1)
    return finish(blend(plain(_SIZE, (206, 210, 212)), (110, 110, 110), 0.8 * worn), rng, 7.0, 0.0)


def _car_glass(rng: np.random.Generator) -> NDArray[np.uint8]:
    tone = smooth_noise(rng, _SIZE, (5, 3))
    return finish(ramp(tone, [-2, 2], [(44, 40, 36), (120, 108, 96)]), rng, 3.0, 0.0)


def _rubber(rng: np.random.Generator) -> NDArray[np.uint8]:
    return finish(
        plain(_SIZE, (38, 38, 38)) * (1 + 0.1 * fractal_noise(rng, _SIZE, 16, 3))[..., None], rng, 4.0, 0.0
    )


def _board(rng: np.random.Generator) -> NDArray[np.uint8]:
    """A board with blocks of print: signs and posters."""
    picture = plain(_SIZE, tuple(rng.uniform(60, 240, 3)))
    for _ in range(26):
        x, y = rng.integers(0, _SIZE, 2)
        width, height = rng.integers(20, 180), rng.integers(10, 60)
        color = tuple(float(v) for v in rng.uniform(20, 240, 3))
        cv2.rectangle(picture, (int(x), int(y)), (int(x + width), int(y + height)), color, -1)
    return finish(picture, rng, 4.0, 0.05)


CITY_TEXTURES: dict[str, TextureSource] = FACADE_TEXTURES | {
    "asphalt": TextureSource(_asphalt, 5.0),
    "paving": TextureSource(_paving, 3.0),
    "cobbles": TextureSource(_cobbles, 3.0),
    "concrete": TextureSource(_concrete, 4.0),
    "corrugated": TextureSource(_corrugated, 4.0, vertical=True),
    "roof_tiles": TextureSource(_roof_tiles, 3.0, vertical=True),
    "paint": TextureSource(_paint, 3.0),
    "marking": TextureSource(_marking, 3.0),
    "car_glass": TextureSource(_car_glass, 3.0),
    "rubber": TextureSource(_rubber, 1.0),
    "board": TextureSource(_board, 2.0, vertical=True),
}
