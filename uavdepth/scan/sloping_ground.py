"""Ground that rises: followed outwards from the vehicle as far as it is seen to go on."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavdepth.scan.level_ground import GROUND_FLOOR_M, LevelGround
from uavdepth.scan.obstacle_scan import FIRST_BEARING_DEG, SECTOR_COUNT, SECTOR_WIDTH_DEG

FLIGHT_CLEARANCE_M = 0.5
"""Ground that comes nearer than this to the flight level from below is in the way like anything else: a
vehicle that flies on level strikes it."""

_NEAREST_M = 0.8
_STEP = 1.12
"""Ratio of the ranges of neighbouring cells."""

_LOWEST, _HIGHEST, _LEVELS = -0.4, 1.4, 72
"""Rises over the ground at the foot that are looked at, in heights of the vehicle."""

_ENOUGH_POINTS = 2
_LOW_QUANTILE = 0.12
"""Of the points of a cell that may be ground: the foot of a thing is among them."""

_LONGEST_GAP = 3
"""Cells without ground that do not end a surface: 40 % of range."""

_REACH = 1.4
"""From near to far by this ratio a surface must go on to be ground; the side or top of a thing does not."""

_NOISE_FLOOR_M = 0.05
_NOISE_SHARE = 0.1
_START_SHARE = 0.12
"""Of the height: an error of depth that lifts the ground by so much is no slope."""


@dataclass(frozen=True)
class GroundProfile:
    """Where rising ground begins, by direction and range.

    Args:
        deepest_m: (72 * cells,) float32: a point that lies deeper below the vehicle is ground; +inf where
            the ground does not rise or was not found.
        shallowest_m: the smallest of them.
        cells: ranges told apart.
    """

    deepest_m: NDArray[np.float32]
    shallowest_m: float
    cells: int

    def is_ground(
        self,
        points: NDArray[np.float32],
        range_m: NDArray[np.float32],
    ) -> NDArray[np.bool_]:
        """(N,) bool for (3, N) points in the level frame with finite coordinates."""
        cell = _element(points[0], points[1]) * self.cells + _cell(range_m, self.cells)
        return np.asarray(points[2] >= self.deepest_m[cell], dtype=np.bool_)


class SlopingGround:
    """Finds ground that rises from the vehicle's foot no steeper than a limit.

    Points are gathered by element and range. Ground goes on from one range to the next where points lie that
    rise over none of the ground before, the vehicle's foot included, by more than the slope allows. A wall, a
    car or a box rises at once, and what hangs in the air has the ground below it. A surface is believed if it
    reaches from near to far, if no ground beside it lies lower by more than the slope allows, and, where its
    beginning is not seen, if it does not come from above the foot: bonnet, windscreen and roof of a parked
    car rise like a slope, but the road beside it does not.

    Args:
        max_slope_deg: steepest ground.
        max_distance_m: ground is followed so far.
        tolerance: relative error of depth that must not make an obstacle of the ground.
    """

    def __init__(self, max_slope_deg: float, max_distance_m: float, tolerance: float) -> None:
        self._slope = math.tan(math.radians(max_slope_deg))
        self._max_distance_m = max_distance_m
        self._tolerance = tolerance
        self._cells = max(1, math.ceil(math.log(max_distance_m / _NEAREST_M) / math.log(_STEP)))
        self._range_m: NDArray[np.float64] = _NEAREST_M * np.power(_STEP, np.arange(self._cells) + 0.5)

    def may_matter(self, ground: LevelGround | None, below_m: float) -> bool:
        """Whether the ground could rise into the height band, and below the flight level there."""
        if ground is None or self._slope <= 0 or ground.deep_m <= FLIGHT_CLEARANCE_M:
            return False
        return ground.height_m - self._slope * self._max_distance_m < below_m

    def find(
        self,
        points: NDArray[np.float32],
        range_m: NDArray[np.float32],
        ground: LevelGround,
    ) -> GroundProfile | None:
        """The rising ground, or None where there is none.

        Args:
            points: (3, N) in the level frame from the vehicle's origin; NaN where unknown.
            range_m: (N,) their horizontal distance.
            ground: the level ground below the vehicle, from which the rising ground is told.
        """
        height_m = ground.height_m
        count, rows = self._gathered(points, range_m, height_m)
        if not rows.size:
            return None
        rise = self._followed(count, height_m)
        self._drop_sheer_sides(rise, rows, height_m)
        self._believe(rise, height_m)
        deepest = self._limits(rise, rows, ground)
        shallowest = float(deepest.min())
        return GroundProfile(deepest, shallowest, self._cells) if math.isfinite(shallowest) else None

    def _gathered(
        self, points: NDArray[np.float32], range_m: NDArray[np.float32], height_m: float
    ) -> tuple[NDArray[np.int64], NDArray[np.intp]]:
        """(rows, cells, levels) how many points, and (rows,) which elements hold any."""
        per_level = _LEVELS / ((_HIGHEST - _LOWEST) * height_m)
        with np.errstate(invalid="ignore", over="ignore"):
            level = (height_m * (1 - _LOWEST) - points[2]) * np.float32(per_level)
            wanted = (level >= 0) & (level < _LEVELS)
            wanted &= (range_m >= _NEAREST_M) & (range_m < self._max_distance_m)
        index = np.flatnonzero(wanted)
        element = _element(points[0, index], points[1, index])
        seen = np.bincount(element, minlength=SECTOR_COUNT) > 0
        row = (np.cumsum(seen) - 1)[element]
        key = (row * self._cells + _cell(range_m[index], self._cells)) * _LEVELS
        key += level[index].astype(np.intp)
        shape = (int(np.count_nonzero(seen)), self._cells, _LEVELS)
        return np.bincount(key, minlength=math.prod(shape)).reshape(shape), np.flatnonzero(seen)

    def _followed(self, count: NDArray[np.int64], height_m: float) -> NDArray[np.float64]:
        """(rows, cells) rise of the ground over the foot, NaN where it does not go on."""
        noise = _NOISE_FLOOR_M + _NOISE_SHARE * height_m
        step = (_HIGHEST - _LOWEST) * height_m / _LEVELS
        lowest = _LOWEST * height_m
        climb = self._slope * self._range_m
        below = count.cumsum(axis=2)
        highest = np.clip((climb + (noise - lowest)) / step, 0, _LEVELS - 1).astype(np.intp)
        points = below[:, np.arange(self._cells), highest]
        level = (below < _LOW_QUANTILE * points[:, :, None]).sum(axis=2)
        rise = np.where(points >= _ENOUGH_POINTS, lowest + step * (level + 0.5), np.nan)
        # Where the steepest ground through any that was passed would start, at range 0. What stands on the
        # ground starts higher than the ground under it, and does not count.
        start = np.fmin(np.fmin.accumulate(rise - climb, axis=1), 0.0)
        start = np.hstack([np.zeros((len(rise), 1)), start[:, :-1]])
        rise[rise > start + climb + noise] = np.nan
        return np.minimum(rise, start + climb)

    def _drop_sheer_sides(self, rise: NDArray[np.float64], rows: NDArray[np.intp], height_m: float) -> None:
        """Take out, in place, what stands higher over the ground beside it than the steepest slope leads.

        Ground that falls away beside is no reason: it counts as level.
        """
        apart = np.abs(rows[:, None] - rows)
        angle = np.radians(SECTOR_WIDTH_DEG) * np.minimum(apart, SECTOR_COUNT - apart)
        chord = 2.0 * np.sin(0.5 * angle)
        beside = np.where(np.isnan(rise), np.inf, np.maximum(rise, 0.0))
        led_m = (beside + self._slope * chord[:, :, None] * self._range_m).min(axis=1)
        rise[rise > led_m + _NOISE_FLOOR_M + _NOISE_SHARE * height_m] = np.nan

    def _believe(self, rise: NDArray[np.float64], height_m: float) -> None:
        """Take out, in place, surfaces that are too short, and first ones that come from above the foot."""
        known = ~np.isnan(rise)
        cells = np.arange(self._cells)
        passed = np.maximum.accumulate(np.where(known, cells, -_LONGEST_GAP - 1), axis=1)
        begins = known.copy()
        begins[:, 1:] &= cells[1:] - passed[:, :-1] > _LONGEST_GAP
        # The cells where the surface that each cell belongs to begins and ends.
        first = np.maximum.accumulate(np.where(begins, cells, 0), axis=1)
        last = np.zeros_like(first)
        row, cell = np.nonzero(known)
        np.maximum.at(last, (row, first[row, cell]), cell)
        reach = self._range_m[last[row, first[row, cell]]] / self._range_m[first[row, cell]]
        known[row, cell] = reach >= _REACH

        nearest = known.argmax(axis=1)[:, None]
        near = known & (first == nearest) & (self._range_m <= 3 * self._range_m[nearest])
        start = _start_of_line(self._range_m, np.where(near, rise, 0.0), near)
        from_above = start > _NOISE_FLOOR_M + _START_SHARE * height_m
        known &= ~(from_above[:, None] & (first == nearest))
        rise[~known] = np.nan

    def _limits(
        self, rise: NDArray[np.float64], rows: NDArray[np.intp], ground: LevelGround
    ) -> NDArray[np.float32]:
        """(72 * cells,) `GroundProfile.deepest_m`."""
        beside = np.full((SECTOR_COUNT + 2, self._cells), np.nan)
        beside[rows + 1] = rise
        beside[0], beside[-1] = beside[-2], beside[1]
        rise = np.where(np.isnan(beside[1:-1]), np.fmin(beside[:-2], beside[2:]), beside[1:-1])
        for _ in range(_LONGEST_GAP):  # ground that is not seen for a bit goes on as it was
            gap = np.isnan(rise[:, 1:]) & ~np.isnan(rise[:, :-1])
            rise[:, 1:][gap] = rise[:, :-1][gap]
        # A cell's far end lies as high as where the next begins.
        farther = np.hstack([rise[:, 1:], rise[:, -1:]])
        rise = np.fmax(rise, (rise + farther) / 2)
        tolerance = max(GROUND_FLOOR_M, self._tolerance * ground.height_m)
        limit = ground.height_m - rise - tolerance
        level = np.minimum(ground.deep_m, ground.height_m - ground.slope * self._range_m)
        rising = limit < level  # NaN is not
        deepest = np.where(rising, np.maximum(limit, FLIGHT_CLEARANCE_M), np.inf)
        return deepest.astype(np.float32).ravel()


def _start_of_line(
    range_m: NDArray[np.float64], rise: NDArray[np.float64], wanted: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """(rows,) rise at range 0 of the line through the wanted cells of each row; rise is 0 elsewhere."""
    number = np.maximum(wanted.sum(axis=1), 1)
    mean_range = (wanted * range_m).sum(axis=1) / number
    mean_rise = rise.sum(axis=1) / number
    off = wanted * (range_m - mean_range[:, None])
    spread = np.maximum(np.square(off).sum(axis=1), 1e-9)
    return np.asarray(mean_rise - mean_range * (off * rise).sum(axis=1) / spread, dtype=np.float64)


def _element(forward_m: NDArray[np.float32], right_m: NDArray[np.float32]) -> NDArray[np.intp]:
    """(N,) element of each direction."""
    bearing = np.arctan2(right_m, forward_m)
    bearing *= np.float32(np.degrees(1.0) / SECTOR_WIDTH_DEG)
    bearing += np.float32(SECTOR_COUNT + 0.5 - FIRST_BEARING_DEG / SECTOR_WIDTH_DEG)
    return bearing.astype(np.intp) % SECTOR_COUNT


def _cell(range_m: NDArray[np.float32], cells: int) -> NDArray[np.intp]:
    """(N,) cell of each range; what is nearer or farther belongs to the first or last."""
    with np.errstate(divide="ignore"):
        cell = np.log(range_m * np.float32(1 / _NEAREST_M)) * np.float32(1 / math.log(_STEP))
    return np.asarray(np.clip(cell, 0, cells - 1), dtype=np.intp)
