"""Textures of nature, painted at true size: a leaf is as large as a leaf, since metres are learnt from it."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from uavdepth.scenes.description import TextureSource
from uavdepth.scenes.noise import cells
from uavdepth.scenes.painting import (
    Gray,
    Picture,
    blend,
    finish,
    fractal_noise,
    ramp,
    scatter,
    smooth_noise,
)

_LEAF = np.array([(-0.5, 0.0), (-0.2, 0.26), (0.1, 0.24), (0.5, 0.0), (0.1, -0.24), (-0.2, -0.26)])
_BLADE = np.array([(-0.5, -0.03), (-0.5, 0.03), (0.5, 0.0)])
_TWIG = np.array([(-0.5, -0.025), (-0.5, 0.025), (0.5, 0.018), (0.5, -0.018)])
_STONE = np.array(
    [(-0.5, -0.1), (-0.3, 0.34), (0.12, 0.4), (0.46, 0.2), (0.5, -0.18), (0.1, -0.4), (-0.32, -0.34)]
)
_SPRIG = np.array([(-0.5, 0.0), (-0.1, 0.16), (0.5, 0.0), (-0.1, -0.16)])


def _filled(size: int, color_bgr: tuple[float, float, float]) -> Picture:
    return np.full((size, size, 3), color_bgr, np.float32)


def _blocks(rng: np.random.Generator, size: int, count: int) -> tuple[Gray, NDArray[np.int32]]:
    """Distance to the border of Voronoi cells as a fraction of the mean cell size, and the cell's number."""
    coarse = 256
    border, owner = cells(rng, coarse, count)
    distance = cv2.resize(border * (count**0.5 / coarse), (size, size), interpolation=cv2.INTER_LINEAR)
    number = cv2.resize(owner, (size, size), interpolation=cv2.INTER_NEAREST)
    return np.asarray(distance, np.float32), np.asarray(number, np.int32)


def _snow(rng: np.random.Generator) -> NDArray[np.uint8]:
    """Wind ripples of a few decimetres over soft drifts."""
    size = 512
    drift = fractal_noise(rng, size, 3, 3)
    warp = smooth_noise(rng, size, 4)
    ripples = fractal_noise(rng, size, (28, 7), 3)
    sheet = 0.5 + 0.16 * drift + 0.16 * ripples + 0.05 * warp
    picture = ramp(sheet, [0, 0.5, 1], [(215, 195, 178), (236, 226, 216), (252, 249, 246)])
    return finish(picture, rng, 5.0, 0.015)


def _rock(rng: np.random.Generator) -> NDArray[np.uint8]:
    """Layered grey stone, cracked into blocks of half a metre, with lichen."""
    size = 1024
    layers = fractal_noise(rng, size, (26, 5), 4, 0.6)
    blotches = fractal_noise(rng, size, 13, 5, 0.7)
    border, index = _blocks(rng, size, 130)
    small_border, _ = _blocks(rng, size, 700)
    shade = rng.uniform(0.84, 1.13, 130).astype(np.float32)[index]
    tone = (0.52 + 0.10 * layers + 0.12 * blotches) * shade
    warm = rng.uniform(-1.0, 1.0)
    dark, middle, light = (
        (46, 48, 50),
        (104 - 8 * warm, 108, 110 + 8 * warm),
        (176, 180 + 3 * warm, 182 + 8 * warm),
    )
    picture = ramp(tone, [0.1, 0.5, 0.95], [dark, middle, light])
    rough = 0.05 * np.abs(smooth_noise(rng, size, 40))
    picture *= (0.45 + 0.55 * np.clip((border - rough) / 0.06, 0, 1))[..., None]
    picture *= (0.72 + 0.28 * np.clip((small_border - rough) / 0.10, 0, 1))[..., None]
    lichen = fractal_noise(rng, size, 20, 4, 0.7) - 1.5
    picture = blend(picture, (96, 165, 168), np.clip(lichen * 2.0, 0, 0.55))
    return finish(picture, rng, 7.0, 0.03)


def _grass(rng: np.random.Generator) -> NDArray[np.uint8]:
    size = 512
    dry = fractal_noise(rng, size, 4, 3)
    picture = ramp(dry, [-1.5, 0, 1.8], [(24, 62, 42), (34, 84, 62), (62, 116, 112)])
    greens = [(54, 118, 92), (46, 102, 74), (74, 138, 118), (92, 150, 146), (60, 124, 88)]
    scatter(picture, rng, _BLADE, 9000, (12, 34), greens, (0.55, 1.2))
    flower = [(230, 240, 245), (60, 215, 240), (215, 150, 200)]
    scatter(picture, rng, _STONE, int(rng.integers(0, 60)), (4, 8), flower, (0.9, 1.0))
    return finish(picture, rng, 5.0, 0.08)


def _moss(rng: np.random.Generator) -> NDArray[np.uint8]:
    size = 512
    cushions = fractal_noise(rng, size, 9, 5, 0.7)
    picture = ramp(cushions, [-2, 0, 2], [(14, 40, 34), (34, 96, 78), (70, 162, 142)])
    scatter(picture, rng, _SPRIG, 2600, (5, 12), [(52, 130, 108), (40, 110, 92), (78, 160, 146)], (0.6, 1.15))
    scatter(picture, rng, _TWIG, 16, (30, 90), [(40, 62, 88)], (0.8, 1.1), shadow=0.6)
    return finish(picture, rng, 5.0, 0.06)


def _leaf_litter(rng: np.random.Generator) -> NDArray[np.uint8]:
    """Fallen leaves of 5 to 11 cm and twigs, on dark earth."""
    size = 1024
    earth = fractal_noise(rng, size, 5, 5)
    picture = ramp(earth, [-2, 0, 2], [(20, 28, 38), (34, 48, 64), (54, 74, 96)])
    browns = [(56, 88, 124), (46, 70, 100), (74, 110, 146), (44, 68, 114), (96, 132, 160), (62, 92, 108)]
    scatter(picture, rng, _LEAF, 3600, (17, 38), browns, (0.5, 1.2), shadow=0.55)
    scatter(
        picture, rng, _TWIG * [1.0, 0.6], 40, (50, 200), [(46, 60, 78), (70, 88, 104)], (0.7, 1.1), shadow=0.5
    )
    damp = fractal_noise(rng, size, 3, 3)
    picture *= (1.0 + 0.16 * damp)[..., None]
    return finish(picture, rng, 5.0, 0.06)


def _needle_floor(rng: np.random.Generator) -> NDArray[np.uint8]:
    """Brown conifer needles, cones and patches of moss."""
    size = 1024
    patches = fractal_noise(rng, size, 4, 5)
    picture = ramp(patches, [-2, 0, 2], [(26, 36, 50), (42, 58, 82), (56, 82, 106)])
    scatter(picture, rng, _TWIG, 9000, (12, 26), [(50, 84, 128), (40, 66, 100), (66, 100, 138)], (0.55, 1.2))
    picture = blend(picture, (44, 108, 88), np.clip(fractal_noise(rng, size, 5, 5) - 0.6, 0, 0.8))
    scatter(picture, rng, _STONE, 60, (24, 44), [(40, 58, 86)], (0.8, 1.1), shadow=0.6)
    scatter(picture, rng, _TWIG * [1.0, 0.6], 30, (60, 230), [(52, 64, 80)], (0.7, 1.2), shadow=0.5)
    return finish(picture, rng, 6.0, 0.05)


def _soil(rng: np.random.Generator) -> NDArray[np.uint8]:
    """Trodden earth of a trail."""
    size = 512
    clods = fractal_noise(rng, size, 4, 6, 0.7)
    picture = ramp(clods, [-2, 0, 2], [(48, 66, 88), (84, 108, 134), (118, 144, 168)])
    scatter(picture, rng, _STONE, 260, (4, 15), [(128, 134, 140), (96, 104, 114)], (0.7, 1.2), shadow=0.4)
    scatter(picture, rng, _LEAF, 60, (9, 19), [(50, 96, 140), (60, 110, 150)], (0.8, 1.1), shadow=0.4)
    return finish(picture, rng, 6.0, 0.05)


def _water(rng: np.random.Generator) -> NDArray[np.uint8]:
    size = 512
    waves = fractal_noise(rng, size, (20, 8), 4, 0.6)
    deep = fractal_noise(rng, size, 3, 3)
    picture = ramp(deep, [-2, 0, 2], [(74, 62, 26), (104, 88, 44), (128, 110, 66)])
    crest = np.abs(waves)
    picture = blend(picture, (214, 204, 190), np.clip(0.55 - crest * 2.4, 0, 0.55))
    picture *= (1.0 + 0.10 * waves)[..., None]
    foam = fractal_noise(rng, size, 10, 4, 0.8)
    white = np.clip((foam - 2.0) * 1.5, 0, 0.8)
    painted = finish(blend(picture, (240, 238, 232), white), rng, 4.0, 0.08)
    gloss = np.clip(150 * (1 - white) + 25 * waves, 0, 255).astype(np.uint8)
    return np.dstack([painted, gloss])


def _bark(rng: np.random.Generator) -> NDArray[np.uint8]:
    """Ridges a few centimetres wide that run along the trunk."""
    size = 512
    ridges = fractal_noise(rng, size, (5, 34), 4, 0.65)
    plates = fractal_noise(rng, size, (12, 18), 3)
    tone = 0.7 * ridges + 0.4 * plates
    picture = ramp(tone, [-1.8, -0.3, 0.4, 1.8], [(16, 20, 26), (44, 58, 74), (70, 88, 106), (118, 136, 152)])
    lichen = fractal_noise(rng, size, 6, 4, 0.7) - 1.2
    picture = blend(picture, (110, 150, 138), np.clip(lichen, 0, 0.5))
    return finish(picture, rng, 6.0, 0.05)


def _birch_bark(rng: np.random.Generator) -> NDArray[np.uint8]:
    size = 512
    sheet = fractal_noise(rng, size, (10, 5), 4)
    picture = ramp(sheet, [-2, 0, 2], [(172, 184, 190), (212, 220, 224), (238, 240, 242)])
    level = (-0.08, 0.08)
    scatter(
        picture,
        rng,
        _TWIG * [1.0, 2.2],
        190,
        (14, 110),
        [(46, 50, 54), (92, 98, 104)],
        (0.8, 1.1),
        0.0,
        level,
    )
    scars = fractal_noise(rng, size, 6, 4) - 1.7
    picture = blend(picture, (36, 38, 42), np.clip(scars * 3, 0, 0.95))
    return finish(picture, rng, 5.0, 0.02)


def _leaves(rng: np.random.Generator) -> NDArray[np.uint8]:
    """Leaves of 6 to 13 cm in layers, dark gaps between twigs."""
    size = 512
    gaps = fractal_noise(rng, size, 7, 4)
    picture = ramp(gaps, [-1.5, 1.5], [(8, 20, 14), (20, 48, 34)])
    greens = [(46, 122, 84), (38, 104, 70), (58, 138, 104), (66, 150, 126), (44, 112, 62)]
    scatter(picture, rng, _LEAF, 1500, (13, 30), greens, (0.4, 1.2), shadow=0.6)
    clusters = fractal_noise(rng, size, 6, 2)
    picture *= np.clip(1.22 + 0.24 * clusters, 0.5, 1.7)[..., None]
    return finish(picture, rng, 5.0, 0.05)


def _needle_layers(rng: np.random.Generator, size: int) -> Picture:
    gaps = fractal_noise(rng, size, 6, 4)
    picture = ramp(gaps, [-1.5, 1.5], [(10, 18, 12), (24, 42, 28)])
    greens = [(46, 82, 44), (38, 70, 36), (60, 98, 56), (70, 108, 74)]
    scatter(picture, rng, _SPRIG, 2600, (18, 46), greens, (0.4, 1.25), shadow=0.5)
    scatter(picture, rng, _TWIG, 2400, (10, 22), greens, (0.8, 1.4))
    return picture * np.float32(1.15)


def _needles(rng: np.random.Generator) -> NDArray[np.uint8]:
    return finish(_needle_layers(rng, 512), rng, 5.0, 0.05)


def _snowy_needles(rng: np.random.Generator) -> NDArray[np.uint8]:
    size = 512
    picture = _needle_layers(rng, size)
    load = fractal_noise(rng, size, 7, 5, 0.7)
    white = ramp(fractal_noise(rng, size, 12, 3), [-2, 2], [(222, 206, 192), (250, 246, 242)])
    return finish(blend(picture, white, np.clip((load + 0.25) * 2.2, 0, 1)), rng, 5.0, 0.02)


def _gravel(rng: np.random.Generator) -> NDArray[np.uint8]:
    """River pebbles of 2 to 9 cm."""
    size = 512
    picture = _filled(size, (52, 58, 64))
    grays = [
        (122, 128, 134),
        (96, 104, 112),
        (148, 154, 158),
        (104, 118, 136),
        (128, 120, 112),
        (172, 176, 178),
    ]
    scatter(picture, rng, _STONE * [1.0, 0.85], 2600, (6, 24), grays, (0.6, 1.15), shadow=0.55)
    return finish(picture, rng, 6.0, 0.04)


def _scree(rng: np.random.Generator) -> NDArray[np.uint8]:
    """Broken stones of 10 to 60 cm."""
    size = 512
    picture = _filled(size, (48, 52, 56))
    grays = [(104, 108, 112), (86, 92, 98), (128, 132, 136), (96, 106, 118), (146, 150, 152)]
    scatter(picture, rng, _STONE, 1500, (11, 62), grays, (0.6, 1.15), shadow=0.6)
    rough = fractal_noise(rng, size, 24, 4, 0.7)
    picture *= (1.0 + 0.09 * rough)[..., None]
    return finish(picture, rng, 6.0, 0.04)


def _sand(rng: np.random.Generator) -> NDArray[np.uint8]:
    size = 512
    ripples = fractal_noise(rng, size, (26, 9), 3)
    patches = fractal_noise(rng, size, 3, 4)
    picture = ramp(
        0.5 * ripples + 0.5 * patches, [-2, 0, 2], [(104, 132, 156), (136, 166, 188), (166, 194, 212)]
    )
    scatter(picture, rng, _STONE, 120, (3, 10), [(120, 128, 136), (90, 100, 112)], (0.8, 1.1), shadow=0.4)
    return finish(picture, rng, 8.0, 0.03)


NATURE_TEXTURES: dict[str, TextureSource] = {
    "snow": TextureSource(_snow, 6.0),
    "rock": TextureSource(_rock, 8.0),
    "grass": TextureSource(_grass, 2.5),
    "moss": TextureSource(_moss, 2.0),
    "leaf_litter": TextureSource(_leaf_litter, 3.0),
    "needle_floor": TextureSource(_needle_floor, 2.5),
    "soil": TextureSource(_soil, 2.5),
    "water": TextureSource(_water, 6.0),
    "bark": TextureSource(_bark, 1.5, vertical=True),
    "birch_bark": TextureSource(_birch_bark, 1.5, vertical=True),
    "leaves": TextureSource(_leaves, 2.2),
    "needles": TextureSource(_needles, 2.2),
    "snowy_needles": TextureSource(_snowy_needles, 2.2),
    "gravel": TextureSource(_gravel, 2.0),
    "scree": TextureSource(_scree, 5.0),
    "sand": TextureSource(_sand, 3.0),
}
"""Every texture of nature by name, with the metres that one repetition spans."""
