"""Textures of walls and house fronts: brick, plaster, panels, windows, shops."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from uavdepth.scenes.description import TextureSource
from uavdepth.scenes.painting import Picture, blend, cracks, finish, fractal_noise, plain, ramp

_SIZE = 512

FACADE_CELL_M = 3.0
"""Width and height of one window's cell; a facade texture holds two by two of them."""

_FACADE_M = 2 * FACADE_CELL_M


def _bricks(rng: np.random.Generator, size_m: float) -> Picture:
    """A brick wall: stretchers of 21.5 x 6.5 cm in half bond."""
    color = np.array([(62, 78, 150), (70, 92, 164), (96, 120, 160), (110, 130, 150)][int(rng.integers(4))])
    columns = round(size_m / 0.225)
    rows = round(size_m / 0.075 / 2) * 2
    picture = plain(_SIZE, (150, 158, 162))
    for row in range(rows):
        top, bottom = row * _SIZE / rows, (row + 1) * _SIZE / rows - max(1.0, _SIZE / rows * 0.14)
        for column in range(columns):
            left = (column + 0.5 * (row % 2)) * _SIZE / columns
            right = left + _SIZE / columns * 0.95
            shade = color * rng.uniform(0.72, 1.15) * rng.uniform(0.95, 1.05, 3)
            for shift in (0, -_SIZE):
                a, b = (int(left + shift), int(top)), (int(right + shift), int(bottom))
                if b[0] >= 0:
                    cv2.rectangle(picture, a, b, tuple(float(v) for v in shade), -1)
    picture *= (1.0 + 0.07 * fractal_noise(rng, _SIZE, 5, 5))[..., None]
    return picture


def _brick_wall(rng: np.random.Generator) -> NDArray[np.uint8]:
    return finish(_bricks(rng, 3.0), rng, 6.0, 0.05)


def _plaster_picture(rng: np.random.Generator) -> Picture:
    tones = [
        (176, 206, 222),
        (196, 200, 204),
        (150, 190, 214),
        (188, 210, 196),
        (214, 214, 206),
        (150, 160, 206),
    ]
    color = np.array(tones[int(rng.integers(len(tones)))], np.float32)
    dirt = fractal_noise(rng, _SIZE, (4, 9), 5)
    picture = plain(_SIZE, tuple(color)) * (1.0 + 0.075 * dirt)[..., None]
    rough = rng.standard_normal((_SIZE, _SIZE)).astype(np.float32)
    picture *= (1.0 + 0.05 * rough)[..., None]
    return blend(picture, color * 0.62, 0.6 * cracks(rng, _SIZE, 3))


def _plaster(rng: np.random.Generator) -> NDArray[np.uint8]:
    return finish(_plaster_picture(rng), rng, 4.0, 0.08)


def _panel_picture(rng: np.random.Generator) -> Picture:
    tone = fractal_noise(rng, _SIZE, (4, 16), 5)
    picture = ramp(tone, [-2.5, 2.5], [(126, 132, 136), (186, 190, 192)])
    for line in (0, _SIZE // 2):
        picture[line : line + 3] *= 0.6
        picture[:, line : line + 3] *= 0.6
    return picture


def _window(rng: np.random.Generator, wide: int, high: int) -> Picture:
    """One window as seen from the street: frame, panes that mirror the sky, curtains or a dark room."""
    frame = np.array([(225, 228, 230), (60, 62, 66), (60, 84, 120), (96, 110, 90)][int(rng.integers(4))])
    picture = np.empty((high, wide, 3), np.float32)
    rise = np.linspace(0, 1, high, dtype=np.float32)[:, None, None]
    top = np.array([150, 130, 112], np.float32) * rng.uniform(0.45, 1.1)
    picture[:] = top * (1 - rise) + np.array([52, 48, 46], np.float32) * rise
    if rng.random() < 0.4:
        tone = rng.uniform(120, 215)
        drop = int(high * rng.uniform(0.25, 0.95))
        folds = 1.0 + 0.12 * np.sin(np.arange(wide) * rng.uniform(0.5, 0.9))
        picture[:drop] = (tone * folds)[None, :, None] * np.array([0.94, 0.98, 1.0])
    thick = max(3, wide // 16)
    cv2.rectangle(picture, (0, 0), (wide - 1, high - 1), tuple(float(v) for v in frame), 2 * thick)
    for share in [0.5] if rng.random() < 0.7 else [0.33, 0.67]:
        x = int(wide * share)
        cv2.line(picture, (x, 0), (x, high), tuple(float(v) for v in frame), thick)
    if rng.random() < 0.5:
        y = int(high * rng.choice([0.3, 0.5]))
        cv2.line(picture, (0, y), (wide, y), tuple(float(v) for v in frame), thick)
    return picture


def _with_windows(
    rng: np.random.Generator,
    wall: Picture,
    width_m: tuple[float, float],
    height_m: tuple[float, float],
    sill: bool,
) -> NDArray[np.uint8]:
    """Set a window into each of the two by two cells of a wall."""
    cell = _SIZE // 2
    pixel = cell / FACADE_CELL_M
    wide = int(rng.uniform(*width_m) * pixel)
    high = int(rng.uniform(*height_m) * pixel)
    top = int((FACADE_CELL_M - 0.55) * pixel) - high if high < 2.2 * pixel else int(0.3 * pixel)
    shutters = sill and rng.random() < 0.3
    for row in range(2):
        for column in range(2):
            x = column * cell + (cell - wide) // 2
            y = row * cell + top
            reveal = wall[max(y - 6, 0) : y + high + 4, max(x - 6, 0) : x + wide + 6]
            reveal *= 0.8
            wall[y : y + high, x : x + wide] = _window(rng, wide, high)
            wall[y : y + 5, x : x + wide] *= 0.55
            if sill:
                cv2.rectangle(
                    wall, (x - 10, y + high), (x + wide + 10, y + high + 7), (190.0, 194.0, 198.0), -1
                )
                wall[y + high + 8 : y + high + 16, x - 8 : x + wide + 8] *= 0.72
            if shutters:
                color = tuple(float(v) for v in rng.uniform(50, 130, 3))
                for left in (x - wide // 2 - 2, x + wide + 2):
                    cv2.rectangle(wall, (left, y), (left + wide // 2, y + high), color, -1)
                    for slat in range(y + 4, y + high, 8):
                        cv2.line(
                            wall, (left, slat), (left + wide // 2, slat), tuple(0.7 * v for v in color), 2
                        )
    return finish(wall, rng, 4.0, 0.07)


def _brick_facade(rng: np.random.Generator) -> NDArray[np.uint8]:
    return _with_windows(rng, _bricks(rng, _FACADE_M), (1.0, 1.4), (1.4, 1.8), True)


def _plaster_facade(rng: np.random.Generator) -> NDArray[np.uint8]:
    return _with_windows(rng, _plaster_picture(rng), (1.0, 1.5), (1.3, 1.9), True)


def _panel_facade(rng: np.random.Generator) -> NDArray[np.uint8]:
    return _with_windows(rng, _panel_picture(rng), (1.6, 2.3), (1.3, 1.6), False)


def _glass_facade(rng: np.random.Generator) -> NDArray[np.uint8]:
    return _with_windows(rng, _panel_picture(rng) * 0.7, (2.5, 2.8), (2.3, 2.5), False)


def _shop(rng: np.random.Generator) -> NDArray[np.uint8]:
    """A ground floor six metres wide: shop window with a sign, and a door; the lower half repeats it."""
    picture = _plaster_picture(rng) * rng.uniform(0.5, 0.95)
    cell = _SIZE // 2
    pixel = cell / FACADE_CELL_M
    for row in range(2):
        base = row * cell
        sign = tuple(float(v) for v in rng.uniform(30, 220, 3))
        cv2.rectangle(picture, (12, base + 14), (_SIZE - 12, base + int(0.55 * pixel)), sign, -1)
        for letter in range(int(rng.integers(5, 14))):
            x = 60 + letter * 28
            glyph = rng.integers(6, 20, 2)
            ink = tuple(float(255 - v) for v in sign)
            cv2.rectangle(picture, (x, base + 22), (x + int(glyph[0]), base + 22 + int(glyph[1])), ink, -1)
        top, bottom = base + int(0.65 * pixel), base + int(2.6 * pixel)
        picture[top:bottom, 24:330] = _window(rng, 306, bottom - top)
        door = _window(rng, int(1.1 * pixel), int(2.2 * pixel)) * rng.uniform(0.5, 0.9)
        left = 380
        picture[base + cell - door.shape[0] : base + cell, left : left + door.shape[1]] = door
        picture[base + int(2.75 * pixel) : base + cell, :360] *= 0.75
    return finish(picture, rng, 5.0, 0.08)


FACADE_TEXTURES: dict[str, TextureSource] = {
    "brick": TextureSource(_brick_wall, 3.0, vertical=True),
    "plaster": TextureSource(_plaster, 4.0, vertical=True),
    "brick_facade": TextureSource(_brick_facade, _FACADE_M, vertical=True),
    "plaster_facade": TextureSource(_plaster_facade, _FACADE_M, vertical=True),
    "panel_facade": TextureSource(_panel_facade, _FACADE_M, vertical=True),
    "glass_facade": TextureSource(_glass_facade, _FACADE_M, vertical=True),
    "shop": TextureSource(_shop, _FACADE_M, vertical=True),
}
