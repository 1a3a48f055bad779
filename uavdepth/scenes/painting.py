"""Brushes for tileable textures: everything wraps around at the picture's borders."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

Gray = NDArray[np.float32]
"""(S, S) values, mostly 0 to 1."""
Picture = NDArray[np.float32]
"""(S, S, 3) BGR, 0 to 255."""


def smooth_noise(rng: np.random.Generator, size: int, cells: int | tuple[int, int]) -> Gray:
    """Tileable cubic noise of mean 0 and deviation 1, with `cells` (or rows, columns) bumps a side."""
    rows, columns = (cells, cells) if isinstance(cells, int) else cells
    grid = rng.standard_normal((rows, columns)).astype(np.float32)
    pad = 2
    wrapped = np.pad(grid, pad, mode="wrap")
    u = (np.arange(size, dtype=np.float32) + 0.5) * columns / size - 0.5 + pad
    v = (np.arange(size, dtype=np.float32) + 0.5) * rows / size - 0.5 + pad
    map_u, map_v = np.meshgrid(u, v)
    noise = np.asarray(cv2.remap(wrapped, map_u, map_v, cv2.INTER_CUBIC), np.float32)
    return np.asarray((noise - noise.mean()) / max(float(noise.std()), 1e-6), np.float32)


def fractal_noise(
    rng: np.random.Generator,
    size: int,
    cells: int | tuple[int, int],
    octaves: int,
    persistence: float = 0.55,
) -> Gray:
    """Sum of `octaves` noises, each twice as fine and `persistence` times as strong; mean 0, deviation 1."""
    rows, columns = (cells, cells) if isinstance(cells, int) else cells
    total = np.zeros((size, size), np.float32)
    for octave in range(octaves):
        fine = (min(rows << octave, size), min(columns << octave, size))
        total += smooth_noise(rng, size, fine) * np.float32(persistence**octave)
    return np.asarray(total / max(float(total.std()), 1e-6), np.float32)


def ramp(values: NDArray[np.floating], stops: ArrayLike, colors_bgr: ArrayLike) -> Picture:
    """Colour a field: piecewise linear between `colors_bgr` (K, 3) at `stops` (K,)."""
    colors = np.asarray(colors_bgr, float)
    channels = [np.interp(values, np.asarray(stops, float), colors[:, channel]) for channel in range(3)]
    return np.stack(channels, axis=-1).astype(np.float32)


def blend(below: Picture, above: ArrayLike, amount: NDArray[np.floating]) -> Picture:
    """`above` (a picture or one colour) over `below` where `amount` (S, S) is 1."""
    weight = np.clip(amount, 0.0, 1.0).astype(np.float32)[..., None]
    return np.asarray(below * (1 - weight) + np.asarray(above, np.float32) * weight, np.float32)


def scatter(
    picture: Picture,
    rng: np.random.Generator,
    outline: NDArray[np.floating],
    count: int,
    length_px: tuple[float, float],
    colors_bgr: ArrayLike,
    brightness: tuple[float, float] = (0.6, 1.15),
    shadow: float = 0.0,
    heading_rad: tuple[float, float] = (0.0, 2 * np.pi),
) -> None:
    """Throw `count` flat pieces onto a picture, in place; pieces over the border come in on the other side.

    Args:
        picture: painted on.
        rng: source of place, turn, size and colour.
        outline: (K, 2) shape of one piece, lengthwise from -0.5 to 0.5 along x.
        count: how many.
        length_px: shortest and longest.
        colors_bgr: (C, 3) colours to draw from.
        brightness: the first pieces, which lie below, get the first factor, the last the second.
        shadow: how dark a piece makes its lower side's surroundings, 0 to 1.
        heading_rad: range of the direction of the pieces' length.
    """
    size = len(picture)
    palette = np.asarray(colors_bgr, float).reshape(-1, 3)
    centres = rng.uniform(0, size, (count, 2))
    turns = rng.uniform(*heading_rad, count)
    lengths = rng.uniform(*length_px, count)
    choices = rng.integers(len(palette), size=count)
    light = np.linspace(*brightness, count) * rng.uniform(0.85, 1.15, count)
    colors = palette[choices] * light[:, None]
    cosine, sine = np.cos(turns), np.sin(turns)
    shape = np.asarray(outline, float)
    x = shape[None, :, 0] * lengths[:, None]
    y = shape[None, :, 1] * lengths[:, None]
    pieces = np.stack(
        [x * cosine[:, None] - y * sine[:, None], x * sine[:, None] + y * cosine[:, None]], axis=-1
    )
    pieces += centres[:, None]
    for piece, color, length in zip(pieces, colors, lengths, strict=True):
        low, high = piece.min(axis=0), piece.max(axis=0)
        shifts_x = [0] + ([size] if low[0] < 2 else []) + ([-size] if high[0] > size - 2 else [])
        shifts_y = [0] + ([size] if low[1] < 2 else []) + ([-size] if high[1] > size - 2 else [])
        for shift_x in shifts_x:
            for shift_y in shifts_y:
                here = piece + np.array([shift_x, shift_y])
                if shadow > 0:
                    dark = tuple(float(c) * (1 - shadow) for c in color)
                    offset = 0.08 * length + 0.7
                    cv2.fillConvexPoly(picture, _fixed(here + offset), dark, cv2.LINE_8, 4)
                cv2.fillConvexPoly(picture, _fixed(here), tuple(map(float, color)), cv2.LINE_8, 4)


def plain(size: int, color_bgr: ArrayLike) -> Picture:
    """A (size, size) picture of one colour."""
    return np.full((size, size, 3), color_bgr, np.float32)


def cracks(rng: np.random.Generator, size: int, count: int) -> Gray:
    """`count` wandering lines, 1 where a crack is and 0 elsewhere."""
    lines = np.zeros((size, size), np.float32)
    for _ in range(count):
        point = rng.uniform(0, size, 2)
        heading = rng.uniform(0, 2 * np.pi)
        for _ in range(int(rng.integers(12, 40))):
            heading += rng.normal(0.0, 0.45)
            step = rng.uniform(5, 12)
            end = point + step * np.array([np.cos(heading), np.sin(heading)])
            for shift in ((0, 0), (size, 0), (-size, 0), (0, size), (0, -size)):
                a = tuple(int(v) for v in point + shift)
                b = tuple(int(v) for v in end + shift)
                cv2.line(lines, a, b, 1.0, 1, cv2.LINE_AA)
            point = end % size
    return lines


def finish(picture: Picture, rng: np.random.Generator, grain: float, hue: float = 0.05) -> NDArray[np.uint8]:
    """Add fine grain (deviation in grey levels) and this variant's own hue, and round to uint8."""
    size = len(picture)
    tinted = picture * (1.0 + rng.uniform(-hue, hue, 3)) * rng.uniform(0.93, 1.07)
    speckle = rng.standard_normal((size, size, 1)) * grain
    return np.clip(tinted + speckle, 0, 255).astype(np.uint8)


def _fixed(points: NDArray[np.floating]) -> NDArray[np.int32]:
    """Points in OpenCV's fixed-point format with 4 fractional bits."""
    return np.round(points * 16).astype(np.int32)
