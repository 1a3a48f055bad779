"""Other textures for the same surfaces: so that shape and motion, not the renderer's materials, tell depth.

Patterns are functions of the place in space, so they lie on the surfaces in true perspective: near they are
large, far small. Filters are random convolutions of the whole picture (Xu et al. 2021, "Robust and
generalizable visual representation learning via random convolutions"): they make up local texture and keep
outlines. Every change takes a (H, W, 3) uint8 BGR picture and returns a new one; depth stays exact.
"""

from __future__ import annotations

from dataclasses import astuple, dataclass
from typing import TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray

from training.data.photo_textures import PhotoTextures, places_of
from training.errors import TrainingDataError, TrainingSettingsError
from uavdepth.camera import CameraModel

Picture: TypeAlias = NDArray[np.uint8]
Field: TypeAlias = NDArray[np.float32]

WAVELENGTHS_M = (0.04, 4.0)
"""Of the patterns: from gravel to painted facades."""

_REGIONS_M = (2.0, 20.0)
"""Wavelengths of the patches that a pattern covers."""

_WAVES = 16
_OCTAVES = 2.5
_FILTER_SIZES = (1, 3, 5)
_PRIMES = (73_856_093, 19_349_663, 83_492_791)
"""Of the spatial hash (Teschner et al. 2003): numbers of cells to one random-looking number."""


@dataclass(frozen=True)
class AppearanceShares:
    """Shares of pictures whose surfaces get another look.

    Args:
        patterns: patterns painted on the surfaces.
        filters: random convolutions.
        photos: photographs on the surfaces, where there are any.
    """

    patterns: float = 0.4
    filters: float = 0.25
    photos: float = 0.4

    def __post_init__(self) -> None:
        for name, share in zip(("patterns", "filters", "photos"), astuple(self), strict=True):
            if not 0.0 <= share <= 1.0:
                raise TrainingSettingsError(f"the share of pictures with {name} is {share}: 0 to 1 is needed")


def change_surfaces(
    rng: np.random.Generator,
    image_bgr: Picture,
    depth_m: Field,
    camera: CameraModel,
    shares: AppearanceShares,
    photos: PhotoTextures | None = None,
) -> Picture:
    """Photographs, patterns, a filter, some of them or none.

    Args:
        rng: decides which and how.
        image_bgr: (H, W, 3) of the camera.
        depth_m: (H, W) z-depth, +inf in the sky.
        camera: in the pixels of the picture.
        shares: how often.
        photos: to lay on surfaces; None for none.

    Raises:
        TrainingDataError: picture, depth and camera are of different sizes.
    """
    if not image_bgr.shape[:2] == depth_m.shape == (camera.height, camera.width):
        raise TrainingDataError(
            f"depth of {depth_m.shape} and a camera of {(camera.height, camera.width)} pixels for a picture "
            f"of {image_bgr.shape[:2]}"
        )
    picture = image_bgr
    if photos is not None and rng.random() < shares.photos:
        picture = photos.paint(rng, picture, depth_m, camera)
    if rng.random() < shares.patterns:
        for _ in range(int(rng.integers(1, 3))):
            picture = surface_pattern(rng, picture, depth_m, camera)
    if rng.random() < shares.filters:
        picture = random_filter(rng, picture)
    return picture


def surface_pattern(
    rng: np.random.Generator, image_bgr: Picture, depth_m: Field, camera: CameraModel
) -> Picture:
    """Blotches, veins, stripes, cells or masonry on some or all surfaces; the sky stays.

    Where a pattern is finer than two pixels it fades into its mean.
    """
    is_surface = np.isfinite(depth_m)
    depth = np.where(is_surface, depth_m, np.float32(1.0))
    places = _random_turn(rng, places_of(depth, camera))
    wavelength = _log_uniform(rng, WAVELENGTHS_M)
    pattern = _PATTERNS[int(rng.integers(len(_PATTERNS)))](rng, places / np.float32(wavelength))
    pixel_m = depth / np.float32(camera.fx)
    contrast = np.clip(np.float32(wavelength / 2.0) / pixel_m - 1.0, 0.0, 1.0)
    gains = _gains(rng)
    share = np.float32(0.5) + contrast * (pattern - np.float32(0.5))
    factors = gains[0] + share[..., None] * (gains[1] - gains[0])
    covered = is_surface & _region(rng, places)
    changed = np.clip(image_bgr * factors, 0.0, 255.0).astype(np.uint8)
    return np.where(covered[..., None], changed, image_bgr)


def random_filter(rng: np.random.Generator, image_bgr: Picture) -> Picture:
    """A random convolution that mixes colours and neighbours, blended with the picture it was made of.

    Mean and spread of each channel are brought back to those of the picture: what is left is another texture.
    """
    size = int(rng.choice(_FILTER_SIZES))
    kernels = rng.normal(0.0, 1.0, (3, 3, size, size)).astype(np.float32)
    source = image_bgr.astype(np.float32)
    channels = [np.ascontiguousarray(source[..., channel]) for channel in range(3)]
    mixed = np.stack(
        [
            sum(cv2.filter2D(channels[i], -1, kernels[o, i], borderType=cv2.BORDER_REFLECT) for i in range(3))
            for o in range(3)
        ],
        axis=-1,
    )
    axes = (0, 1)
    spread = np.maximum(mixed.std(axes), np.float32(1e-3))
    restored = (mixed - mixed.mean(axes)) / spread * source.std(axes) + source.mean(axes)
    share = np.float32(rng.uniform(0.2, 0.9))
    return np.asarray(np.clip(source + share * (restored - source), 0.0, 255.0), np.uint8)


# -- patterns: (H, W) in 0..1 of places in units of the wavelength


def _blotches(rng: np.random.Generator, places: Field) -> Field:
    """Smooth, or with edges as hard as those of paint."""
    hardness = _log_uniform(rng, (1.0, 12.0))
    return _sigmoid(np.float32(hardness) * (_waves(rng, places) + np.float32(rng.normal(0.0, 0.4))))


def _veins(rng: np.random.Generator, places: Field) -> Field:
    """Dark lines where a field crosses zero: cracks, marble."""
    return np.tanh(np.abs(_waves(rng, places)) * np.float32(_log_uniform(rng, (1.5, 8.0))))


def _stripes(rng: np.random.Generator, places: Field) -> Field:
    """Bars along one direction, straight or wavering: cladding, wood."""
    waver = np.float32(rng.uniform(0.0, 1.0) ** 2) * _waves(rng, places * np.float32(0.5))
    bars = np.sin(np.float32(2.0 * np.pi) * places[..., 0] + waver * np.float32(4.0))
    return _sigmoid(np.float32(_log_uniform(rng, (1.0, 8.0))) * bars)


def _patches(rng: np.random.Generator, places: Field) -> Field:
    """Blocks, each of a brightness of its own."""
    return _brightness(np.floor(places).astype(np.int64))


def _masonry(rng: np.random.Generator, places: Field) -> Field:
    """Courses of blocks with joints between them, every other course shifted by half a block."""
    course = np.floor(places[..., 1])
    along = places[..., 0] * np.float32(rng.uniform(0.3, 0.7)) + np.float32(0.5) * (course % 2)
    block = np.floor(along)
    joint = np.float32(rng.uniform(0.05, 0.15))
    is_joint = (places[..., 1] - course < joint) | (along - block < joint * np.float32(0.5))
    depth = np.floor(places[..., 2] * np.float32(0.3))
    blocks = _brightness(np.stack((block, course, depth), axis=-1).astype(np.int64))
    return np.where(is_joint, np.float32(0.0), np.float32(0.35) + np.float32(0.65) * blocks)


_PATTERNS = (_blotches, _veins, _stripes, _patches, _masonry)


def _waves(rng: np.random.Generator, places: Field) -> Field:
    """A random field of standard deviation 1: plane waves of falling amplitude over some octaves."""
    octaves = rng.uniform(0.0, _OCTAVES, _WAVES)
    directions = rng.normal(0.0, 1.0, (3, _WAVES))
    directions *= 2.0 * np.pi * 2.0**octaves / np.linalg.norm(directions, axis=0)
    amplitudes = 2.0 ** (-octaves * rng.uniform(0.5, 1.5))
    amplitudes *= np.sqrt(2.0) / np.linalg.norm(amplitudes)
    phases = places.reshape(-1, 3) @ directions.astype(np.float32)
    phases += rng.uniform(0.0, 2.0 * np.pi, _WAVES).astype(np.float32)
    field = np.cos(phases) @ amplitudes.astype(np.float32)
    return np.asarray(field.reshape(places.shape[:-1]), np.float32)


def _region(rng: np.random.Generator, places: Field) -> NDArray[np.bool_]:
    """Where a pattern lies: all surfaces, or patches of them."""
    if rng.random() < 0.5:
        return np.ones(places.shape[:-1], np.bool_)
    field = _waves(rng, places / np.float32(_log_uniform(rng, _REGIONS_M)))
    return np.asarray(field > rng.uniform(-1.0, 0.5), np.bool_)


def _brightness(cells: NDArray[np.int64]) -> Field:
    """(H, W) in 0..1 by the numbers (H, W, 3) of a cell."""
    mixed = (cells[..., 0] * _PRIMES[0]) ^ (cells[..., 1] * _PRIMES[1]) ^ (cells[..., 2] * _PRIMES[2])
    mixed ^= mixed >> 13
    mixed *= 0x5BD1E995
    return np.asarray(((mixed >> 15) & 0xFF) / 255.0, np.float32)


def _gains(rng: np.random.Generator) -> Field:
    """(2, 3): by what the picture's channels are multiplied where the pattern is 0, and where it is 1."""
    brightness = np.exp(rng.normal(0.0, 0.5, (2, 1)))
    colour = np.exp(rng.normal(0.0, rng.uniform(0.02, 0.3), (2, 3)))
    return np.asarray(np.clip(brightness * colour, 0.15, 3.0), np.float32)


def _random_turn(rng: np.random.Generator, places: Field) -> Field:
    """The places in a frame turned at random; half of the time about the vertical only, as walls stand."""
    if rng.random() < 0.5:
        angle = rng.uniform(0.0, 2.0 * np.pi)
        cos, sin = np.cos(angle), np.sin(angle)
        turn = np.array([[cos, 0.0, sin], [0.0, 1.0, 0.0], [-sin, 0.0, cos]])
    else:
        turn = np.linalg.qr(rng.normal(0.0, 1.0, (3, 3)))[0]
    return np.asarray(places @ turn.astype(np.float32), np.float32)


def _sigmoid(values: Field) -> Field:
    return np.asarray(np.float32(0.5) + np.float32(0.5) * np.tanh(np.float32(0.5) * values))


def _log_uniform(rng: np.random.Generator, limits: tuple[float, float]) -> float:
    return float(np.exp(rng.uniform(*np.log(limits))))
