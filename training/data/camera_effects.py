"""What weather, lens, sensor and link do to a picture without moving what it shows: the depth stays exact.

Every effect takes (H, W, 3) uint8 BGR and returns a new picture of that shape; what it draws comes from the
generator alone. Sizes are parts of the picture's width, so that they look alike at any size.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray

from training.data.lens_effects import lens_dirt, rain_drops
from training.errors import TrainingDataError

Picture: TypeAlias = NDArray[np.uint8]
Effect: TypeAlias = Callable[[np.random.Generator, Picture, NDArray[np.float32]], Picture]

COUNT_SHARES = (0.34, 0.36, 0.21, 0.09)
"""Share of pictures that get none, one, two and three effects."""

_UNITY = 64
"""A gain of 1 where gains are bytes: they reach almost 4."""


def camera_effects(rng: np.random.Generator, image_bgr: Picture, depth_m: NDArray[np.float32]) -> Picture:
    """A random few of the effects, in the order in which light meets them; a third of the pictures gets none.

    Args:
        rng: decides what and how much.
        image_bgr: (H, W, 3).
        depth_m: (H, W), +inf in the sky.

    Raises:
        TrainingDataError: picture and depth are of different sizes.
    """
    if depth_m.shape != image_bgr.shape[:2]:
        raise TrainingDataError(f"depth of {depth_m.shape} for a picture of {image_bgr.shape[:2]} pixels")
    count = int(rng.choice(len(COUNT_SHARES), p=COUNT_SHARES))
    picture = image_bgr
    for number in sorted(rng.choice(len(EFFECTS), count, replace=False)):
        picture = EFFECTS[number](rng, picture, depth_m)
    return picture


def haze(rng: np.random.Generator, image_bgr: Picture, depth_m: NDArray[np.float32]) -> Picture:
    """Air between 25 and 500 m of visibility: I = J t + A (1 - t), t = exp(-beta d) (Koschmieder).

    Visibility is where 5 % of the contrast is left, beta = 3 / visibility.
    """
    beta = 3.0 / np.exp(rng.uniform(np.log(25.0), np.log(500.0)))
    through = np.nan_to_num(np.exp(np.float32(-beta) * depth_m), copy=False)
    gray = rng.uniform(140.0, 245.0)
    air = np.empty_like(image_bgr)
    air[:] = np.clip(gray + rng.uniform(-8.0, 12.0) * np.array([1.0, 0.3, -1.0]), 0.0, 255.0)
    return np.asarray(cv2.blendLinear(image_bgr, air, through, 1.0 - through), np.uint8)


def rain_streaks(rng: np.random.Generator, image_bgr: Picture) -> Picture:
    """Falling drops, drawn out by the exposure: slanted brighter lines, most of them faint."""
    height, width = image_bgr.shape[:2]
    count = int(rng.integers(40, 250))
    slant, reach = rng.normal(0.0, 0.25), rng.uniform(0.02, 0.07) * width
    start = rng.uniform((0.0, -reach), (width, height), (count, 2))
    run = rng.uniform(0.4, 1.0, (count, 1)) * reach * np.array([slant, 1.0])
    lines = np.rint(16.0 * np.stack((start, start + run), axis=1)).astype(np.int32)
    sheet = np.zeros((height, width), np.uint8)
    for part in np.array_split(lines, 3):
        cv2.polylines(sheet, list(part), False, int(rng.integers(15, 70)), 1, cv2.LINE_AA, 4)
    sheet = np.asarray(cv2.blur(sheet, (1, 3)), np.uint8)
    return np.asarray(cv2.add(image_bgr, cv2.cvtColor(sheet, cv2.COLOR_GRAY2BGR)), np.uint8)


def motion_blur(rng: np.random.Generator, image_bgr: Picture) -> Picture:
    """The camera turns during the exposure: a straight smear about each pixel's own place."""
    length = np.exp(rng.uniform(np.log(0.005), np.log(0.03))) * image_bgr.shape[1]
    angle = rng.uniform(0.0, np.pi)
    along = length / 2 * np.array([np.cos(angle), np.sin(angle)])
    half = int(np.ceil(length / 2)) + 1
    kernel = np.zeros((2 * half + 1, 2 * half + 1), np.float32)
    ends = np.rint(256.0 * np.stack((half - along, half + along))).astype(int)
    cv2.line(kernel, ends[0].tolist(), ends[1].tolist(), 1.0, 1, cv2.LINE_8, 8)
    # Symmetric about its centre, whatever rounding did to the line: nothing may move.
    kernel += kernel[::-1, ::-1]
    return np.asarray(cv2.filter2D(image_bgr, -1, kernel / kernel.sum()), np.uint8)


def sun_glare(rng: np.random.Generator, image_bgr: Picture) -> Picture:
    """Sun in or near the picture: a glow around it and a veil over everything."""
    height, width = image_bgr.shape[:2]
    # The glow is smooth: an eighth of the size is enough.
    rows, columns = max(2, height // 8), max(2, width // 8)
    sun_x, sun_y = rng.uniform(-0.3, 1.3), rng.uniform(-0.4, 0.5) * height / width
    x, y = np.arange(columns) / columns - sun_x, np.arange(rows) / columns - sun_y
    distance = np.hypot(x[None, :], y[:, None])
    veil = rng.uniform(5.0, 45.0)
    glow = veil + rng.uniform(100.0, 320.0) * np.exp(-distance / rng.uniform(0.06, 0.25))
    tint = np.array([rng.uniform(0.7, 0.95), rng.uniform(0.88, 1.0), 1.0])
    small = np.minimum(glow[..., None] * tint, 255.0).astype(np.uint8)
    light = cv2.resize(small, (width, height), interpolation=cv2.INTER_LINEAR)
    # Screens rather than adds: stray light lowers the contrast of the shadows most.
    kept = cv2.multiply(image_bgr, cv2.bitwise_not(light), scale=1.0 / 255.0)
    return np.asarray(cv2.add(kept, light), np.uint8)


def vignette(rng: np.random.Generator, image_bgr: Picture) -> Picture:
    """Corners darker by up to two thirds, as 1 / (1 + k r^2)^2 (cos^4 of a simple lens)."""
    squared = _squared_radius(*image_bgr.shape[:2])
    shade = 255.0 / np.square(1.0 + np.float32(rng.uniform(0.1, 0.75)) * squared)
    return _times(image_bgr, shade.astype(np.uint8)[..., None], 255)


def exposure_change(rng: np.random.Generator, image_bgr: Picture) -> Picture:
    """Too bright or too dark, clipped, and still changing while the rows are read out."""
    gain = np.exp(rng.choice([-1.0, 1.0]) * rng.uniform(0.2, 0.8))
    rows = gain * np.linspace(1.0, np.exp(rng.normal(0.0, 0.2)), image_bgr.shape[0])
    levels = np.clip(np.rint(rows * _UNITY), 1, 255).astype(np.uint8)
    return _times(image_bgr, levels[:, None, None], _UNITY)


def color_cast(rng: np.random.Generator, image_bgr: Picture) -> Picture:
    """White balance that is wrong by up to a fifth a channel, and shadows with a colour of their own."""
    gains, lift = np.exp(rng.normal(0.0, 0.08, 3).clip(-0.2, 0.2)), rng.uniform(0.0, 12.0, 3)
    levels = np.arange(256.0)[:, None]
    table = np.clip(levels * gains * (1.0 - lift / 255.0) + lift, 0.0, 255.0).astype(np.uint8)
    return np.asarray(cv2.LUT(image_bgr, table[None]), np.uint8)


def chroma_noise(rng: np.random.Generator, image_bgr: Picture) -> Picture:
    """Noise after the colour filter's interpolation: blotches of two pixels, each channel with its own."""
    height, width = image_bgr.shape[:2]
    shape = ((height + 1) // 2, (width + 1) // 2, 3)
    sigma = rng.uniform(3.0, 16.0)
    # The sum of two uniform bytes is bell-shaped enough, of deviation 104, and ten times as fast to draw.
    first, second = rng.integers(0, 256, (2, *shape), np.uint8)
    blotches = (first.astype(np.float32) + second - 255.0) * np.float32(sigma / 104.0)
    blotches = cv2.resize(blotches, (width, height), interpolation=cv2.INTER_LINEAR)
    return np.asarray(cv2.add(image_bgr, blotches, dtype=cv2.CV_8U), np.uint8)


def video_blocks(rng: np.random.Generator, image_bgr: Picture) -> Picture:
    """A starved video link: sent smaller, coarsely quantised in blocks of eight pixels, enlarged again."""
    height, width = image_bgr.shape[:2]
    scale = rng.uniform(0.6, 1.0)
    size = (max(8, round(width * scale)), max(8, round(height * scale)))
    small = cv2.resize(image_bgr, size, interpolation=cv2.INTER_AREA)
    packed = cv2.imencode(".jpg", small, [cv2.IMWRITE_JPEG_QUALITY, int(rng.integers(12, 40))])[1]
    decoded = np.asarray(cv2.imdecode(packed, cv2.IMREAD_COLOR), np.uint8)
    return np.asarray(cv2.resize(decoded, (width, height), interpolation=cv2.INTER_LINEAR), np.uint8)


def _times(image_bgr: Picture, levels: Picture, unity: int) -> Picture:
    """The picture times levels / unity, rounded and clipped."""
    factors = np.ascontiguousarray(np.broadcast_to(levels, image_bgr.shape))
    return np.asarray(cv2.multiply(image_bgr, factors, scale=1.0 / unity), np.uint8)


@lru_cache(maxsize=8)
def _squared_radius(height: int, width: int) -> NDArray[np.float32]:
    """(H, W): 0 in the middle, 1 in the corners; shared, not to be written to."""
    x, y = (np.arange(width) + 0.5) / width - 0.5, (np.arange(height) + 0.5) / height - 0.5
    squared = np.square(x * width)[None, :] + np.square(y * height)[:, None]
    return np.asarray(squared / squared.max(), np.float32)


def _without_depth(effect: Callable[[np.random.Generator, Picture], Picture]) -> Effect:
    return lambda rng, image_bgr, _: effect(rng, image_bgr)


EFFECTS: tuple[Effect, ...] = (
    haze,
    *map(
        _without_depth,
        (
            rain_streaks,
            rain_drops,
            lens_dirt,
            sun_glare,
            motion_blur,
            vignette,
            exposure_change,
            color_cast,
            chroma_noise,
            video_blocks,
        ),
    ),
)
"""All effects from the air to the link."""
