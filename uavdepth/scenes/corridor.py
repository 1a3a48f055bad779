"""The way north from the take-off place that every world keeps free, up to what ends it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from uavdepth.scenes.solids import Point


@dataclass(frozen=True)
class Corridor:
    """A strip from the origin north to a front.

    Args:
        end_m: where the front stands.
        half_width_m: half the strip's width.
        front_half_m: half the width of the front that stays free to see.
        front_depth_m: how far before the front nothing stands.
        origin_m: radius around the take-off place.
    """

    end_m: float
    half_width_m: float = 3.8
    front_half_m: float = 13.0
    front_depth_m: float = 17.0
    origin_m: float = 6.0

    def is_free(self, low: Point, high: Point) -> bool:
        """Whether the rectangle between two points lies outside."""
        centre = (0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]))
        half = (0.5 * abs(high[0] - low[0]), 0.5 * abs(high[1] - low[1]))
        return bool(self._outside(np.array([centre]), np.array(half))[0])

    def is_free_around(self, places: ArrayLike, reach_m: ArrayLike) -> NDArray[np.bool_]:
        """(K,) whether things of (K,) reach at (K, 2) places stand outside."""
        reach = np.asarray(reach_m, float)[..., None]
        return self._outside(
            np.atleast_2d(np.asarray(places, float)), np.concatenate([reach, reach], axis=-1)
        )

    def _outside(self, centres: NDArray[np.float64], half: NDArray[np.float64]) -> NDArray[np.bool_]:
        low_n, high_n = centres[:, 0] - half[..., 0], centres[:, 0] + half[..., 0]
        east = np.abs(centres[:, 1]) - half[..., 1]
        in_strip = (high_n > 0.0) & (low_n < self.end_m) & (east < self.half_width_m)
        at_front = (high_n > self.end_m - self.front_depth_m) & (low_n < self.end_m + 1.0)
        at_front &= east < self.front_half_m
        nearest = np.maximum(np.abs(centres) - half, 0.0)
        at_origin = np.hypot(nearest[:, 0], nearest[:, 1]) < self.origin_m
        return np.asarray(~(in_strip | at_front | at_origin))
