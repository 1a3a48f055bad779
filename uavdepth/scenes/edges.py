"""Smooth edges: more samples for the pixels in which two surfaces meet."""

from __future__ import annotations

import numpy as np

from uavdepth.scenes.kernels import kernel

SAMPLES = 4
"""Samples of an edge pixel."""

_SUBPIXELS = np.array(((-0.125, -0.375), (0.375, -0.125), (0.125, 0.375), (-0.375, 0.125)), np.float32)
"""Where they lie from its centre, in pixels: a rotated grid."""

_BRIGHTEST = np.float32(1.5)
"""A lens and its sensor clip before they mix, so one sample of the sun does not fill a pixel."""


@kernel
def edge_pixels(height, width, face, t, normals, lit, texture):  # type: ignore[no-untyped-def]
    """(K,) int64 numbers of the pixels that need more than one sample: whose right or lower neighbour shows
    another surface, and those neighbours.

    Args:
        height, width: of the picture; the other arguments have one row per pixel, row by row.
        face, t: hits. normals: (N, 3). lit: whether the sun reaches the hit. texture: its number.
    """
    marked = np.zeros(height * width, np.bool_)
    count = 0
    for row in range(height):
        for column in range(width):
            i = row * width + column
            for other in range(2):
                if other == 0:
                    if column + 1 == width:
                        continue
                    j = i + 1
                else:
                    if row + 1 == height:
                        continue
                    j = i + width
                if face[i] == face[j]:
                    differs = lit[i] != lit[j]
                elif face[i] < 0 or face[j] < 0:
                    differs = True
                else:
                    along = (
                        normals[i, 0] * normals[j, 0]
                        + normals[i, 1] * normals[j, 1]
                        + normals[i, 2] * normals[j, 2]
                    )
                    step = abs(t[i] - t[j]) / min(t[i], t[j])
                    differs = (
                        along < 0.9
                        or texture[i] != texture[j]
                        or lit[i] != lit[j]
                        or (step > 0.05 and along < 0.999)
                        or step > 0.5
                    )
                if differs:
                    count += (not marked[i]) + (not marked[j])
                    marked[i] = True
                    marked[j] = True
    pixels = np.empty(count, np.int64)
    place = 0
    for i in range(height * width):
        if marked[i]:
            pixels[place] = i
            place += 1
    return pixels


@kernel
def edge_rays(directions, across, along, pixels):  # type: ignore[no-untyped-def]
    """(K * SAMPLES, 3) float32 rays of the samples in each of K pixels.

    Args:
        directions: (N, 3) rays of the pixels' centres.
        across, along: (N, 3) their change per pixel to the right and downwards.
        pixels: (K,) which ones.
    """
    rays = np.empty((len(pixels) * SAMPLES, 3), np.float32)
    for k in range(len(pixels)):
        i = pixels[k]
        for s in range(SAMPLES):
            for axis in range(3):
                rays[k * SAMPLES + s, axis] = (
                    directions[i, axis]
                    + _SUBPIXELS[s, 0] * across[i, axis]
                    + _SUBPIXELS[s, 1] * along[i, axis]
                )
    return rays


@kernel
def mix_samples(linear, pixels, samples):  # type: ignore[no-untyped-def]
    """Give each of K pixels of `linear` (N, 3) the mean of its rows in `samples` (K * SAMPLES, 3)."""
    for k in range(len(pixels)):
        for channel in range(3):
            total = np.float32(0.0)
            for s in range(SAMPLES):
                total += min(samples[k * SAMPLES + s, channel], _BRIGHTEST)
            linear[pixels[k], channel] = total / np.float32(SAMPLES)
