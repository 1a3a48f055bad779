"""Tileable random fields that the procedural textures, the clouds and the terrain are painted with."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Field = NDArray[np.float32]


def cloud_noise(
    rng: np.random.Generator, size: int, slope: float = 1.6, coarsest: float = 1.0, finest: float = 0.0
) -> Field:
    """Tileable noise with a power-law spectrum.

    Args:
        rng: source of randomness.
        size: side in pixels.
        slope: amplitude falls as frequency ** -slope: 0 white, 1 rough, 2 smooth.
        coarsest: lowest frequency kept, in cycles per tile.
        finest: highest frequency kept, in cycles per tile; 0 keeps all.

    Returns:
        (size, size) float32 with mean 0 and standard deviation 1.
    """
    spectrum = np.fft.rfft2(rng.standard_normal((size, size), dtype=np.float32))
    fy = np.fft.fftfreq(size)[:, None] * size
    fx = np.fft.rfftfreq(size)[None, :] * size
    frequency = np.hypot(fy, fx)
    gain = np.where(frequency >= coarsest, np.maximum(frequency, 1e-6) ** -slope, 0.0)
    if finest > 0:
        gain = gain * np.exp(-((frequency / finest) ** 4))
    gain[0, 0] = 0.0
    field = np.fft.irfft2(spectrum * gain, s=(size, size))
    return np.asarray(field / max(float(field.std()), 1e-12), np.float32)


def cells(rng: np.random.Generator, size: int, count: int) -> tuple[Field, NDArray[np.int32]]:
    """Tileable Voronoi cells, for cracks, stones and leaves.

    Args:
        rng: source of randomness.
        size: side in pixels.
        count: number of cells.

    Returns:
        (size, size) float32 difference between the distances to the second and the first nearest centre,
        in pixels (0 on the borders between cells), and (size, size) int32 number of the cell.
    """
    centres = rng.random((count, 2)).astype(np.float32) * size
    y, x = np.mgrid[0:size, 0:size].astype(np.float32)
    first = np.full((size, size), np.inf, np.float32)
    second = np.full((size, size), np.inf, np.float32)
    owner = np.zeros((size, size), np.int32)
    for number, (cy, cx) in enumerate(centres):
        dy = np.abs(y - cy)
        dx = np.abs(x - cx)
        dy = np.minimum(dy, size - dy)
        dx = np.minimum(dx, size - dx)
        distance = np.hypot(dy, dx)
        nearer = distance < first
        second = np.where(nearer, first, np.minimum(second, distance))
        owner = np.where(nearer, np.int32(number), owner)
        first = np.where(nearer, distance, first)
    return second - first, owner
