"""Hints at the five resolutions of the network that ships: what of it depends on nothing else is made here.

In the network's graph the same took a fifth of its time: some 150 operations on small maps, each a turn of
every core, and the two planes in full size. `training.networks.hint_levels` defines it for training; a test
holds both against each other, and so does every export.

A point is a value (log q, see `uavdepth.model.hint_planes`) with a weight (its confidence). Sums of both pool
from level to level; the gaps are filled coarse to fine ("push-pull", Gortler et al. 1996, section 3.4).
"""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from uavdepth.errors import HintError
from uavdepth.model.point_pixels import PointPixels

LEVELS = 5
"""1/2, 1/4, 1/8, 1/16 and 1/32 of the picture."""

LEVEL_CHANNELS = 5
"""Filled log q of the points, their weight, whether there is one, log q of the ground, its share."""

SUMMARY_CHANNELS = 3
"""Mean log q of the points, their number, whether there is one: of the whole picture."""

MEASURED_CHANNELS = 3
"""At half size: mean log q of the points, their weight, mean log q of the ground."""

NEARNESS_CHANNELS = 4
"""At half size: share of the ground, weight of the points in the cells of `WEIGHT_LEVELS` around."""

WEIGHT_LEVELS = (0, 2, 4)
"""Levels whose weights of points tell how far the next one is."""

SMALLEST_Q = 1e-4
"""Smaller q, 10 km away, is no hint that anybody gives; it keeps the logarithm of "no hint" finite."""

PRIOR_WEIGHT = 0.25
"""Weight of the coarser level in a cell: a quarter of a sure point's, so that one point rules its cell."""

NEIGHBOURHOODS = (3, 7)
"""Cells of the coarsest level that stand for each other before the whole picture does."""

LOG_Q_MEAN = -2.5
LOG_Q_SPREAD = 1.5
"""About those of a frame's pixels: 12 m, and from 2.7 to 55 m within one spread."""

WHOLE_PRIOR = 1e-3
LEAST_WEIGHT = 1e-6
COUNT_SCALE = 5.0

_Array = NDArray[np.float32]


class _Level(NamedTuple):
    """(h, w) each: sums of weight times log q and of weight of the points, the same means of the ground."""

    total: _Array
    weight: _Array
    ground: _Array
    share: _Array

    @property
    def ground_mean(self) -> _Array:
        return np.asarray(self.ground / np.maximum(self.share, np.float32(LEAST_WEIGHT)), np.float32)


def hint_shapes(width: int, height: int) -> dict[str, tuple[int, int, int, int]]:
    """Names and shapes of the network's inputs for hints.

    Args:
        width, height: of its picture.

    Raises:
        HintError: a size that is no multiple of 32.
    """
    if width % 2**LEVELS or height % 2**LEVELS or min(width, height) < 2**LEVELS:
        raise HintError(f"the network's size is {width}x{height}: multiples of {2**LEVELS} are needed")
    half = (height // 2, width // 2)
    levels = {
        f"hints_{2 ** (level + 1)}": (1, LEVEL_CHANNELS, half[0] >> level, half[1] >> level)
        for level in range(LEVELS)
    }
    return {
        **levels,
        "hints_summary": (1, SUMMARY_CHANNELS, 1, 1),
        "hints_measured": (1, MEASURED_CHANNELS, *half),
        "hints_nearness": (1, NEARNESS_CHANNELS, *half),
    }


def hint_levels(ground: _Array, points: PointPixels) -> dict[str, _Array]:
    """The network's inputs for hints, by name: see `hint_shapes`. All are 0 where nothing is known.

    Args:
        ground: (H, W) q of the flat ground, 0 where there is none (`ground_plane`).
        points: at the pixels of a picture of that size (`point_pixels`).

    Raises:
        HintError: a size that is no multiple of 32.
    """
    height, width = ground.shape
    # Every plane is written below; zeros first would take a seventh of the time.
    inputs = {name: np.empty(shape, np.float32) for name, shape in hint_shapes(width, height).items()}
    pyramid = _pyramid(ground, points)
    measured, nearness = inputs["hints_measured"][0], inputs["hints_nearness"][0]
    filled = _filled(pyramid) if len(points) else None
    for number, level in enumerate(pyramid):
        channels = inputs[f"hints_{2 ** (number + 1)}"][0]
        np.multiply(_normalised(level.ground_mean), level.share, out=channels[3])
        channels[4] = level.share
        if filled is None:
            channels[:3] = 0.0
            continue
        channels[0] = _normalised(filled[number])
        np.log1p(level.weight, out=channels[1])
        np.minimum(level.weight, np.float32(1.0), out=channels[2])
        if number in WEIGHT_LEVELS:
            nearness[1 + WEIGHT_LEVELS.index(number)] = _doubled(channels[1], number)
    finest = pyramid[0]
    measured[2], nearness[0] = finest.ground_mean, finest.share
    if filled is None:
        measured[:2], nearness[1:] = 0.0, 0.0
        inputs["hints_summary"][:] = 0.0
    else:
        np.divide(finest.total, np.maximum(finest.weight, np.float32(LEAST_WEIGHT)), out=measured[0])
        measured[1] = finest.weight
        inputs["hints_summary"][0, :, 0, 0] = _summary(pyramid[-1])
    return inputs


def _pyramid(ground: _Array, points: PointPixels) -> list[_Level]:
    """Both hints at every level, finest first."""
    height, width = ground.shape
    size = (height // 2, width // 2)
    total, weight, logs, share = (np.zeros(size, np.float32) for _ in range(4))
    if len(points):
        row, column = points.cells(size[1], size[0])
        logs_of_points = points.confidence * np.log(np.maximum(points.q, np.float32(SMALLEST_Q)))
        total, weight = (
            np.bincount(row * size[1] + column, values, total.size).reshape(size).astype(np.float32)
            for values in (logs_of_points, points.confidence)
        )
    rows = np.flatnonzero((ground > 0).any(axis=1))
    if len(rows):
        # Above the horizon is nothing to take a logarithm of.
        first = int(rows[0]) // 2
        below = ground[2 * first :]
        known = (below > 0).astype(np.float32)
        full = np.maximum(below, np.float32(SMALLEST_Q))
        np.log(full, out=full)
        full *= known
        logs[first:], share[first:] = _halved(full), _halved(known)
    levels = [_Level(total, weight, logs, share)]
    while len(levels) < LEVELS:
        finer = levels[-1]
        four = np.float32(4.0)
        levels.append(
            _Level(
                _halved(finer.total) * four,
                _halved(finer.weight) * four,
                _halved(finer.ground),
                _halved(finer.share),
            )
        )
    return levels


def _filled(pyramid: list[_Level]) -> list[_Array]:
    """Dense log q of every level, finest first."""
    coarsest = pyramid[-1]
    mean = coarsest.total.sum() / (coarsest.weight.sum() + np.float32(WHOLE_PRIOR))
    value = np.full_like(coarsest.total, mean)
    for size in reversed(NEIGHBOURHOODS):
        value = _blended(_around(coarsest.total, size), _around(coarsest.weight, size), value)
    filled = [_blended(coarsest.total, coarsest.weight, value)]
    for level in reversed(pyramid[:-1]):
        filled.append(_blended(level.total, level.weight, _doubled(filled[-1], 1)))
    return filled[::-1]


def _summary(coarsest: _Level) -> tuple[float, float, float]:
    count = float(coarsest.weight.sum())
    mean = float(coarsest.total.sum()) / max(count, LEAST_WEIGHT)
    return (mean - LOG_Q_MEAN) / LOG_Q_SPREAD, float(np.log1p(count)) / COUNT_SCALE, 1.0


def _normalised(log_q: _Array) -> _Array:
    numbers = log_q - np.float32(LOG_Q_MEAN)
    numbers /= np.float32(LOG_Q_SPREAD)
    return numbers


def _blended(total: _Array, weight: _Array, coarser: _Array) -> _Array:
    prior = np.float32(PRIOR_WEIGHT)
    blended = coarser * prior
    blended += total
    blended /= weight + prior
    return np.asarray(blended, np.float32)


def _around(sums: _Array, size: int) -> _Array:
    """Sums over a square of `size` cells around each cell."""
    found = cv2.boxFilter(sums, -1, (size, size), normalize=False, borderType=cv2.BORDER_CONSTANT)
    return np.asarray(found, np.float32)


def _halved(maps: _Array) -> _Array:
    """Means of four."""
    size = (maps.shape[1] // 2, maps.shape[0] // 2)
    return np.asarray(cv2.resize(maps, size, interpolation=cv2.INTER_AREA), np.float32)


def _doubled(values: _Array, times: int) -> _Array:
    """Twice as large so many times, bilinear, pixel centres aligned."""
    for _ in range(times):
        size = (2 * values.shape[1], 2 * values.shape[0])
        values = np.asarray(cv2.resize(values, size, interpolation=cv2.INTER_LINEAR), np.float32)
    return values
