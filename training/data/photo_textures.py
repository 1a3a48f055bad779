"""Photographs as textures of rendered surfaces: what the renderer's painter has never thought of.

A photograph is laid on every surface along the two axes that it faces least (triplanar mapping), in metres,
so that it shrinks with distance; it takes the surface's own light. Depth stays exact.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from training.errors import TrainingDataError
from uavdepth.camera import CameraModel

Picture = NDArray[np.uint8]
Field = NDArray[np.float32]

ENDINGS = (".png", ".jpg", ".jpeg")

TILE_M = (1.0, 25.0)
"""Width of surface that a photograph covers."""

_LARGEST_SIDE = 512
_SMALLEST_SIDE = 32
_LEVELS = 6
_NEIGHBOURS = 7
_ROW = 1024
_PAINTED_SHARE = 0.7
"""Of the directions that surfaces face in."""

_LIGHT_BLUR = 0.02
"""Width of the blur, as a share of the picture's, that takes a surface's texture and leaves its light."""


class PhotoTextures:
    """Photographs of a folder and the folders in it, made small.

    Args:
        folder: with PNG or JPEG files.

    Raises:
        TrainingDataError: no folder, no photograph in it, or one that cannot be read or is smaller than 32
            pixels.
    """

    def __init__(self, folder: Path) -> None:
        paths = sorted(path for path in folder.rglob("*") if path.suffix.lower() in ENDINGS)
        if not paths:
            raise TrainingDataError(f"{folder}: no photographs there ({', '.join(ENDINGS)})")
        self._pyramids = [_pyramid(_read(path)) for path in paths]

    def __len__(self) -> int:
        return len(self._pyramids)

    def paint(
        self, rng: np.random.Generator, image_bgr: Picture, depth_m: Field, camera: CameraModel
    ) -> Picture:
        """The picture with photographs on the surfaces of most of the three main directions.

        Args:
            rng: chooses photographs, their size and how much of the surfaces' own look stays.
            image_bgr: (H, W, 3) of the camera.
            depth_m: (H, W) z-depth, +inf in the sky, which stays as it is.
            camera: in the pixels of the picture.
        """
        is_surface = np.isfinite(depth_m)
        places = places_of(np.where(is_surface, depth_m, np.float32(1.0)), camera)
        facing = _facing(places)
        light = _light(image_bgr)
        changed = image_bgr.copy()
        for axis, (across, along) in enumerate(((2, 1), (0, 2), (0, 1))):
            on = (facing == axis) & is_surface
            pyramid = self._pyramids[int(rng.integers(len(self._pyramids)))]
            texels_per_m = np.float32(pyramid[0].shape[1] / np.exp(rng.uniform(*np.log(TILE_M))))
            offset = rng.uniform(0.0, 1000.0, 2).astype(np.float32)
            share = np.float32(rng.uniform(0.5, 1.0))
            if rng.random() < _PAINTED_SHARE:
                there = places[on]
                x, y = there[:, across] * texels_per_m + offset[0], there[:, along] * texels_per_m + offset[1]
                footprint = there[:, 2] * (texels_per_m / np.float32(camera.fx))
                colours = _sampled(pyramid, x, y, footprint) * light[on][:, None]
                mixed = image_bgr[on] + share * (colours - image_bgr[on])
                changed[on] = np.clip(mixed, 0.0, 255.0).astype(np.uint8)
        return changed


def places_of(depth_m: Field, camera: CameraModel) -> Field:
    """(H, W, 3) metres in the camera's frame, by the pinhole alone: a texture need not know the lens."""
    x = (np.arange(camera.width, dtype=np.float32) - np.float32(camera.cx)) / np.float32(camera.fx)
    y = (np.arange(camera.height, dtype=np.float32) - np.float32(camera.cy)) / np.float32(camera.fy)
    return np.stack((depth_m * x[None, :], depth_m * y[:, None], depth_m), axis=-1)


def _read(path: Path) -> Picture:
    photo = cv2.imread(str(path), cv2.IMREAD_COLOR)
    if photo is None:
        raise TrainingDataError(f"{path}: this photograph cannot be read")
    height, width = photo.shape[:2]
    if min(height, width) < _SMALLEST_SIDE:
        raise TrainingDataError(f"{path}: {width}x{height} pixels; at least {_SMALLEST_SIDE} are needed")
    shrink = min(1.0, _LARGEST_SIDE / max(height, width))
    if shrink < 1.0:
        size = max(1, round(width * shrink)), max(1, round(height * shrink))
        photo = cv2.resize(photo, size, interpolation=cv2.INTER_AREA)
    return np.asarray(photo, np.uint8)


def _pyramid(photo: Picture) -> list[Picture]:
    """The photograph and halves of it, down to hardly more than its mean (Williams 1983)."""
    levels = [photo]
    while len(levels) < _LEVELS and min(levels[-1].shape[:2]) >= 4:
        height, width = levels[-1].shape[:2]
        half = cv2.resize(levels[-1], (width // 2, height // 2), interpolation=cv2.INTER_AREA)
        levels.append(np.asarray(half, np.uint8))
    return levels


def _sampled(pyramid: Sequence[Picture], x: Field, y: Field, footprint: Field) -> Field:
    """(N, 3) colours, as shares of the photograph's mean, at (N,) texels that repeat mirrored.

    Args:
        pyramid: the photograph and its halves.
        x, y: texels of the photograph.
        footprint: texels that a pixel covers.
    """
    wanted = np.rint(np.log2(np.maximum(footprint, np.float32(1.0))))
    level_of = np.minimum(wanted, len(pyramid) - 1).astype(np.int32)
    colours = np.empty((len(x), 3), np.float32)
    for level, photo in enumerate(pyramid):
        here = np.flatnonzero(level_of == level)
        if len(here):
            scale = np.float32(0.5**level)
            colours[here] = _bilinear(photo, x[here] * scale, y[here] * scale)
    mean = np.maximum(pyramid[-1].reshape(-1, 3).mean(axis=0), 8.0)
    return np.asarray(colours / mean.mean(), np.float32)


def _bilinear(photo: Picture, x: Field, y: Field) -> Picture:
    """(N, 3) colours at (N,) texels. OpenCV takes maps of fewer than 32768 columns, so they come in rows."""
    height, width = photo.shape[:2]
    padding = (0, -len(x) % _ROW)
    columns = np.pad(_mirrored(x, width), padding).reshape(-1, _ROW)
    rows = np.pad(_mirrored(y, height), padding).reshape(-1, _ROW)
    colours = cv2.remap(photo, columns, rows, cv2.INTER_LINEAR)
    return np.asarray(colours.reshape(-1, 3)[: len(x)], np.uint8)


def _mirrored(texel: Field, size: int) -> Field:
    """Texels of an endless row of photographs, every other one mirrored, inside the first."""
    period = np.float32(2 * (size - 1))
    return np.abs(np.mod(texel, period) - np.float32(size - 1))


def _facing(places: Field) -> NDArray[np.int64]:
    """(H, W) the axis that each pixel's surface faces most, by the places of its neighbours.

    Stored depth comes in steps, and so do the places: one pixel's slope says nothing.
    """
    smooth = cv2.blur(places, (_NEIGHBOURS, _NEIGHBOURS))
    normals = np.cross(np.gradient(smooth, axis=1), np.gradient(smooth, axis=0))
    normals /= np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), 1e-12)
    normals = cv2.blur(normals, (_NEIGHBOURS, _NEIGHBOURS))
    return np.asarray(np.argmax(np.abs(normals), axis=-1), np.int64)


def _light(image_bgr: Picture) -> Field:
    """(H, W) brightness of what a surface reflects, without its own texture."""
    blur = max(1.0, _LIGHT_BLUR * image_bgr.shape[1])
    return np.asarray(cv2.GaussianBlur(image_bgr.mean(axis=2, dtype=np.float32), (0, 0), blur))
