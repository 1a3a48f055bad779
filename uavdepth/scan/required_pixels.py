"""How many pixels make an obstacle: a thing at each distance, and a wire across the way."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from uavdepth.camera import CameraModel, CameraMount
from uavdepth.scan.obstacle_scan import SECTOR_WIDTH_DEG, sector_bearings_deg

SMALLEST_SIZE_M = 0.25
"""Side of the square that must be found at maximum distance; sets the default of min_pixels."""

SMALLEST_AREA_M2 = 0.01
"""Nearer things must show this much of themselves: 2 cm of pole over half a metre."""

LARGEST_SHARE = 0.05
"""But never more than this share of an element's pixels: something very near fills the view."""

LINE_SHARE = 0.6
"""Share of an element's breadth that a wire has to cover in it and in its neighbours (see `RangeHistogram`);
half of what makes the others may be lost as single pixels."""

_FEWEST_PIXELS = 6
_FEWEST_OF_LINE = 4


def smallest_thing(camera: CameraModel, max_distance_m: float) -> int:
    """Pixels of a square of `SMALLEST_SIZE_M` at maximum distance, but at least 6."""
    return max(_FEWEST_PIXELS, round(camera.fx * camera.fy * (SMALLEST_SIZE_M / max_distance_m) ** 2))


def pixels_of_thing(
    camera: CameraModel, distance_m: NDArray[np.float32], min_pixels: int, together: int
) -> NDArray[np.int64]:
    """(N,) joined pixels that make an obstacle at each distance.

    Args:
        camera: whose pixels they are.
        distance_m: (N + 1,) edges of the bins of distance, metres, above 0.
        min_pixels: pixels that are always needed.
        together: rows that are joined.
    """
    element = camera.fx * math.radians(SECTOR_WIDTH_DEG) * camera.height
    shown = camera.fx * camera.fy * SMALLEST_AREA_M2 / np.square(distance_m[:-1].astype(np.float64))
    most = max(min_pixels, int(LARGEST_SHARE * element))
    return np.ceil(np.clip(shown, min_pixels, most) / together).astype(np.int64)


def pixels_of_line(camera: CameraModel, mount: CameraMount, together: int) -> NDArray[np.int64]:
    """(72,) joined pixels of a level line one pixel thin in each element, times `LINE_SHARE`."""
    aside = np.radians((sector_bearings_deg().astype(np.float64) - mount.yaw_deg + 180) % 360 - 180)
    # Pixels lie the denser in angle the farther from the middle; 80 degrees off none has any.
    stretch = 1 / np.square(np.maximum(np.cos(aside), 0.17))
    on_its_side = abs(math.sin(math.radians(mount.roll_deg))) > 0.7
    across = camera.fy / together if on_its_side else camera.fx
    breadth = across * math.radians(SECTOR_WIDTH_DEG) * stretch
    return np.maximum(np.ceil(LINE_SHARE * breadth), _FEWEST_OF_LINE).astype(np.int64)
