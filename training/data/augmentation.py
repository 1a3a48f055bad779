"""Random changes that keep depth exact: other crops and mirror images, other light and other lenses."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

MAX_ZOOM = 1.3
MAX_STRETCH = 1.12
WIDE_SHARE = 0.3
MAX_WIDENING = 1.8
"""Some cameras have pictures much wider than the network's 2:1, up to 3.5:1; stretched to it they show things
taller than they are. Their share, and by how much the window is wider than 2:1 at most."""


@dataclass(frozen=True)
class Crop:
    """A window of the stored picture that becomes the network's picture.

    Args:
        left, top, width, height: in pixels of the stored picture.
        mirrored: whether left and right are swapped.
    """

    left: int
    top: int
    width: int
    height: int
    mirrored: bool


def sample_crop(rng: np.random.Generator, width: int, height: int) -> Crop:
    """A window of at least 1 / `MAX_ZOOM` of the picture's width, its aspect a little off or much wider."""
    zoom = rng.uniform(1.0, MAX_ZOOM)
    stretch = MAX_STRETCH ** rng.uniform(-1.0, 1.0)
    widening = rng.uniform(1.0, MAX_WIDENING) if rng.random() < WIDE_SHARE else 1.0
    crop_width = min(width, round(width / zoom * stretch**0.5))
    crop_height = min(height, round(height / zoom / stretch**0.5 / widening))
    left = int(rng.integers(0, width - crop_width + 1))
    top = int(rng.integers(0, height - crop_height + 1))
    return Crop(left, top, crop_width, crop_height, bool(rng.random() < 0.5))


def cut_image(image: NDArray[np.uint8], crop: Crop, width: int, height: int) -> NDArray[np.uint8]:
    """The window, resized to the network's size by area."""
    window = image[crop.top : crop.top + crop.height, crop.left : crop.left + crop.width]
    resized = cv2.resize(window, (width, height), interpolation=cv2.INTER_AREA)
    return np.asarray(resized[:, ::-1] if crop.mirrored else resized, np.uint8)


def cut_depth(depth_m: NDArray[np.float32], crop: Crop, width: int, height: int) -> NDArray[np.float32]:
    """The window of the depth map by nearest pixel: no depth is made up between a post and what is behind."""
    window = depth_m[crop.top : crop.top + crop.height, crop.left : crop.left + crop.width]
    resized = cv2.resize(window, (width, height), interpolation=cv2.INTER_NEAREST_EXACT)
    return np.asarray(resized[:, ::-1] if crop.mirrored else resized, np.float32)


def change_light(rng: np.random.Generator, image_bgr: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Another exposure, white balance, saturation, noise, sharpness and compression."""
    picture = image_bgr
    if rng.random() < 0.8:
        picture = np.asarray(cv2.LUT(picture, _tone_curves(rng)), np.uint8)
    if rng.random() < 0.5:
        picture = _resaturated(picture, rng.uniform(0.3, 1.5))
    if rng.random() < 0.3:
        picture = np.asarray(cv2.GaussianBlur(picture, (0, 0), rng.uniform(0.3, 1.2)), np.uint8)
    if rng.random() < 0.4:
        picture = _noisy(rng, picture)
    if rng.random() < 0.25:
        quality = int(rng.integers(25, 90))
        packed = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, quality])[1]
        picture = np.asarray(cv2.imdecode(packed, cv2.IMREAD_COLOR), np.uint8)
    return picture


def _tone_curves(rng: np.random.Generator) -> NDArray[np.uint8]:
    """(1, 256, 3) look-up table: gamma, contrast, brightness, and a gain of each channel."""
    level = np.linspace(0.0, 1.0, 256)[:, None]
    gamma = np.exp(rng.uniform(-0.35, 0.35))
    contrast, brightness = rng.uniform(0.7, 1.3), rng.uniform(-0.12, 0.12)
    gains = rng.uniform(0.88, 1.12, 3)
    curve = ((level**gamma - 0.5) * contrast + 0.5 + brightness) * gains
    table = np.clip(np.rint(curve * 255.0), 0, 255)
    return np.asarray(table[None], np.uint8)


def _resaturated(picture: NDArray[np.uint8], amount: float) -> NDArray[np.uint8]:
    gray = cv2.cvtColor(cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY), cv2.COLOR_GRAY2BGR)
    return np.asarray(cv2.addWeighted(picture, amount, gray, 1.0 - amount, 0.0), np.uint8)


def _noisy(rng: np.random.Generator, picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
    noise = rng.standard_normal(picture.shape, dtype=np.float32) * np.float32(rng.uniform(1.0, 10.0))
    return np.clip(picture + noise, 0, 255).astype(np.uint8)
