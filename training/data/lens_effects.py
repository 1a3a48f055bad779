"""What sits on the front lens: drops of water and dirt. Too near to be sharp, too small to move the scene."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

SMALLEST_DROP, LARGEST_DROP = 0.02, 0.08
"""Diameters of drops as parts of the picture's width."""

_VIEW = 3.0
"""A drop shows a picture of what lies within this many of its diameters, as a ball lens does: upside down."""


def rain_drops(rng: np.random.Generator, image_bgr: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Two to eleven drops: each a small upside-down blurred view of its surroundings with a soft edge.

    Args:
        rng: decides where and how large.
        image_bgr: (H, W, 3).
    """
    height, width = image_bgr.shape[:2]
    picture = image_bgr.copy()
    for _ in range(int(rng.integers(2, 12))):
        diameter = width * np.exp(rng.uniform(np.log(SMALLEST_DROP), np.log(LARGEST_DROP)))
        size = max(3, round(diameter))
        left, top = (int(rng.integers(0, max(1, side - size))) for side in (width, height))
        _add_drop(rng, image_bgr, picture[top : top + size, left : left + size], left, top)
    return picture


def _add_drop(
    rng: np.random.Generator, scene: NDArray[np.uint8], patch: NDArray[np.uint8], left: int, top: int
) -> None:
    rows, columns = patch.shape[:2]
    margin = round((_VIEW - 1.0) / 2 * max(rows, columns))
    view = scene[max(0, top - margin) : top + rows + margin, max(0, left - margin) : left + columns + margin]
    inverted = cv2.resize(view, (columns, rows), interpolation=cv2.INTER_AREA)[::-1, ::-1]
    blurred = cv2.GaussianBlur(np.ascontiguousarray(inverted), (0, 0), rng.uniform(0.03, 0.12) * columns)
    x, y = (np.linspace(-1.0, 1.0, count, dtype=np.float32) for count in (columns, rows))
    radius = np.hypot(x[None, :] * np.float32(rng.uniform(1.0, 1.4)), y[:, None])
    # A rim that is out of focus, and light gathered in the lower half.
    cover = np.clip((1.0 - radius) / np.float32(rng.uniform(0.2, 0.5)), 0.0, 1.0)[..., None]
    light = 1.0 + np.float32(rng.uniform(0.1, 0.4)) * y[:, None, None]
    mixed = patch * (1.0 - cover) + blurred * (cover * light)
    patch[:] = np.minimum(mixed, 255.0).astype(np.uint8)


def lens_dirt(rng: np.random.Generator, image_bgr: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Smears that blur and veil parts of the picture, and specks that darken it.

    Args:
        rng: decides where and how much.
        image_bgr: (H, W, 3).
    """
    height, width = image_bgr.shape[:2]
    field = cv2.resize(rng.random((5, 8), np.float32), (width, height), interpolation=cv2.INTER_CUBIC)
    level = rng.uniform(0.5, 0.8)
    smear = np.clip(
        (field - np.float32(level)) * np.float32(3.0), 0.0, rng.uniform(0.4, 0.95), dtype=np.float32
    )
    specks = np.zeros((height, width), np.uint8)
    for x, y, part in rng.random((int(rng.integers(0, 12)), 3)):
        radius = round(16.0 * width * (0.003 + 0.012 * part))
        center = (round(16.0 * width * x), round(16.0 * height * y))
        cv2.circle(specks, center, radius, int(rng.integers(60, 200)), -1, cv2.LINE_AA, 4)
    if specks.any():
        specks = np.asarray(cv2.GaussianBlur(specks, (0, 0), 0.004 * width + 0.3), np.uint8)
    veil = cv2.blur(image_bgr, (2 * (width // 40) + 1,) * 2)
    veil = cv2.addWeighted(veil, 0.75, np.full_like(veil, int(rng.integers(60, 190))), 0.25, 0.0)
    smeared = cv2.blendLinear(image_bgr, veil, 1.0 - smear, smear)
    kept = cv2.cvtColor(cv2.bitwise_not(specks), cv2.COLOR_GRAY2BGR)
    return np.asarray(cv2.multiply(smeared, kept, scale=1.0 / 255.0), np.uint8)
