"""Textures of streets and houses: asphalt, paving, brick, facades with windows, roofs, paint."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
from numpy.typing import NDArray

from uavdepth.scenes.description import TextureMaker, TextureSource
from uavdepth.scenes.painting import Gray, Picture, blend, finish, fractal_noise, ramp, smooth_noise

_SIZE = 512

FACADE_CELL_M = 3.0
"""Width and height of one window's cell; a facade texture holds two by two of them."""

_FACADE_M = 2 * FACADE_CELL_M


def _plain(color_bgr: tuple[float, float, float]) -> Picture:
    return np.full((_SIZE, _SIZE, 3), color_bgr, np.float32)


def _cracks(rng: np.random.Generator, count: int) -> Gray:
    """Wandering dark lines, 1 where a crack is."""
    lines = np.zeros((_SIZE, _SIZE), np.float32)
    for _ in range(count):
        point = rng.uniform(0, _SIZE, 2)
        heading = rng.uniform(0, 2 * np.pi)
        for _ in range(int(rng.integers(12, 40))):
            heading += rng.normal(0.0, 0.45)
            step = rng.uniform(5, 12)
            end = point + step * np.array([np.cos(heading), np.sin(heading)])
            for shift in ((0, 0), (_SIZE, 0), (-_SIZE, 0), (0, _SIZE), (0, -_SIZE)):
                a = tuple(int(v) for v in point + shift)
                b = tuple(int(v) for v in end + shift)
                cv2.line(lines, a, b, 1.0, 1, cv2.LINE_AA)
            point = end % _SIZE
    return lines


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
    picture = blend(picture, (34, 36, 38), 0.8 * _cracks(rng, 7))
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
    picture = _plain((52, 54, 56))
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
    return finish(blend(picture, (80, 84, 86), 0.5 * _cracks(rng, 2)), rng, 5.0, 0.04)


def _bricks(rng: np.random.Generator, size_m: float) -> Picture:
    """A brick wall: stretchers of 21.5 x 6.5 cm in half bond."""
    color = np.array([(62, 78, 150), (70, 92, 164), (96, 120, 160), (110, 130, 150)][int(rng.integers(4))])
    columns = round(size_m / 0.225)
    rows = round(size_m / 0.075 / 2) * 2
    picture = _plain((150, 158, 162))
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
    picture = _plain(tuple(color)) * (1.0 + 0.075 * dirt)[..., None]
    rough = rng.standard_normal((_SIZE, _SIZE)).astype(np.float32)
    picture *= (1.0 + 0.05 * rough)[..., None]
    return blend(picture, color * 0.62, 0.6 * _cracks(rng, 3))


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
    picture = np.asarray(_plain(tuple(color)) * (1.0 + 0.16 * ribs)[None, :, None], np.float32)
    rust = np.clip(fractal_noise(rng, _SIZE, (3, 14), 5) - 0.9, 0, 1)
    picture = blend(picture, (48, 76, 120), 0.9 * rust)
    for y in range(20, _SIZE, 128):
        for column in range(16):
            cv2.circle(picture, (column * 32 + 8, y), 3, (60.0, 60.0, 64.0), -1, cv2.LINE_AA)
    picture[:3] *= 0.5
    return finish(picture, rng, 5.0, 0.05)


def _paint(rng: np.random.Generator) -> NDArray[np.uint8]:
    """Painted metal: nearly white, so that the tint is its colour."""
    picture = _plain((205, 205, 205)) * (1.0 + 0.06 * fractal_noise(rng, _SIZE, 4, 5))[..., None]
    return finish(picture, rng, 4.0, 0.0)


def _marking(rng: np.random.Generator) -> NDArray[np.uint8]:
    """Worn white road paint."""
    worn = np.clip(fractal_noise(rng, _SIZE, 12, 4) - 0.7, 0, 1)
    return finish(blend(_plain((206, 210, 212)), (110, 110, 110), 0.8 * worn), rng, 7.0, 0.0)


def _car_glass(rng: np.random.Generator) -> NDArray[np.uint8]:
    tone = smooth_noise(rng, _SIZE, (5, 3))
    return finish(ramp(tone, [-2, 2], [(44, 40, 36), (120, 108, 96)]), rng, 3.0, 0.0)


def _rubber(rng: np.random.Generator) -> NDArray[np.uint8]:
    return finish(
        _plain((38, 38, 38)) * (1 + 0.1 * fractal_noise(rng, _SIZE, 16, 3))[..., None], rng, 4.0, 0.0
    )


def _board(rng: np.random.Generator) -> NDArray[np.uint8]:
    """A board with blocks of print: signs and posters."""
    picture = _plain(tuple(rng.uniform(60, 240, 3)))
    for _ in range(26):
        x, y = rng.integers(0, _SIZE, 2)
        width, height = rng.integers(20, 180), rng.integers(10, 60)
        color = tuple(float(v) for v in rng.uniform(20, 240, 3))
        cv2.rectangle(picture, (int(x), int(y)), (int(x + width), int(y + height)), color, -1)
    return finish(picture, rng, 4.0, 0.05)


def _source(
    make: Callable[[np.random.Generator], NDArray[np.uint8]], size_m: float, vertical: bool = False
) -> TextureSource:
    maker: TextureMaker = make
    return TextureSource(maker, size_m, vertical)


CITY_TEXTURES: dict[str, TextureSource] = {
    "asphalt": _source(_asphalt, 5.0),
    "paving": _source(_paving, 3.0),
    "cobbles": _source(_cobbles, 3.0),
    "concrete": _source(_concrete, 4.0),
    "brick": _source(_brick_wall, 3.0, True),
    "plaster": _source(_plaster, 4.0, True),
    "corrugated": _source(_corrugated, 4.0, True),
    "brick_facade": _source(_brick_facade, _FACADE_M, True),
    "plaster_facade": _source(_plaster_facade, _FACADE_M, True),
    "panel_facade": _source(_panel_facade, _FACADE_M, True),
    "glass_facade": _source(_glass_facade, _FACADE_M, True),
    "shop": _source(_shop, _FACADE_M, True),
    "roof_tiles": _source(_roof_tiles, 3.0, True),
    "paint": _source(_paint, 3.0),
    "marking": _source(_marking, 3.0),
    "car_glass": _source(_car_glass, 3.0),
    "rubber": _source(_rubber, 1.0),
    "board": _source(_board, 2.0, True),
}
