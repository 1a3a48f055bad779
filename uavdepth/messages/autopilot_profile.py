"""How each autopilot has to be told of obstacles: the layout that it reads without loss."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from uavdepth.errors import ScanError
from uavdepth.scan.obstacle_scan import FIRST_BEARING_DEG, SECTOR_COUNT, SECTOR_WIDTH_DEG, sector_bearings_deg

LEAST_INCREMENT_DEG = 5.0
"""Below it PX4 reads past the 72 words and sees memory contents as obstacles (measured, 1.15.4 and 1.18)."""


@dataclass(frozen=True)
class AutopilotProfile:
    """The layout of OBSTACLE_DISTANCE for one kind of autopilot; it always covers the full circle once.

    The words are the same for all: an obstacle is min + 1 to max - 1 centimetres, nearer ones are raised to
    min + 1 (at or below min ArduPilot and PX4 1.15 drop them, and PX4 1.18's set point becomes NaN), clear is
    max + 1 and unknown 65535.

    Args:
        name: as in the configuration.
        element_count: words that are used, from the first; the others of the 72 are unknown.
        increment_deg: width of an element, 5 degrees at least.
        first_bearing_deg: centre of element 0, clockwise from the nose.
        takes_points: reads OBSTACLE_DISTANCE_3D.

    Raises:
        ScanError: an increment below 5 degrees, or elements that are not one full circle.
    """

    name: str
    element_count: int
    increment_deg: float
    first_bearing_deg: float
    takes_points: bool = False

    def __post_init__(self) -> None:
        if self.increment_deg < LEAST_INCREMENT_DEG:
            raise ScanError(
                f"profile {self.name}: increment_deg is {self.increment_deg}: at least "
                f"{LEAST_INCREMENT_DEG:g} degrees is needed"
            )
        if self.element_count * self.increment_deg != 360.0:
            raise ScanError(
                f"profile {self.name}: {self.element_count} elements of {self.increment_deg:g} degrees are "
                "not the full circle"
            )

    def merge(self, words: NDArray[np.uint16], clear_word: int) -> NDArray[np.uint16]:
        """The scan's 72 words of 5 degrees in this layout.

        An element tells the nearest obstacle that reaches into it. Without one it is clear only if
        everything in it is clear: doubt is unknown.

        Args:
            words: (72,) uint16, legal words: obstacles below `clear_word`, unknown 65535 above it.
            clear_word: the word that means clear.

        Returns:
            (72,) uint16, unknown from `element_count` on.
        """
        inside = words[_sectors_inside(self.element_count, self.increment_deg, self.first_bearing_deg)]
        nearest, farthest = inside.min(axis=1), inside.max(axis=1)
        merged = np.full(SECTOR_COUNT, np.iinfo(np.uint16).max, dtype=np.uint16)
        merged[: self.element_count] = np.where(nearest < clear_word, nearest, farthest)
        return merged


@lru_cache(maxsize=8)
def _sectors_inside(count: int, increment_deg: float, first_deg: float) -> NDArray[np.intp]:
    """(count, M) indices of the scan's sectors that overlap each element; shorter rows repeat their first."""
    centre = first_deg + increment_deg * np.arange(count)
    apart = np.abs((sector_bearings_deg()[None, :] - centre[:, None] + 180.0) % 360.0 - 180.0)
    rows = [np.flatnonzero(row) for row in apart < (increment_deg + SECTOR_WIDTH_DEG) / 2 - 1e-6]
    longest = max(len(row) for row in rows)
    return np.array([np.pad(row, (0, longest - len(row)), constant_values=row[0]) for row in rows])


ARDUPILOT = AutopilotProfile(
    "ardupilot", SECTOR_COUNT, SECTOR_WIDTH_DEG, FIRST_BEARING_DEG, takes_points=True
)
"""5 degrees from -155: begins inside the rear face, so that no other 45 degree face is visited twice, of
which ArduPilot keeps the last visit only (measured, ArduCopter 4.8-dev)."""

PX4 = AutopilotProfile("px4", SECTOR_COUNT, SECTOR_WIDTH_DEG, FIRST_BEARING_DEG)
"""PX4 1.18: its own 5 degree bins, each filled by one element (measured)."""

PX4_LEGACY = AutopilotProfile("px4-legacy", 36, 10.0, -180.0)
"""PX4 1.15 has bins of 10 degrees and looks at one element for each; this layout loses nothing there, nor
on 1.18 (measured)."""

PROFILES = {profile.name: profile for profile in (ARDUPILOT, PX4, PX4_LEGACY)}
"""Profiles by name."""
