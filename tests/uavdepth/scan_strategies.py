"""Any scan, for properties that hold for every one."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st

from uavdepth import ObstacleScan, SectorState
from uavdepth.scan.obstacle_scan import sector_bearings_deg


def scan_of(distance_m, state, nearest: float = 0.2, farthest: float = 20.0) -> ObstacleScan:
    """A scan in which only obstacles have a distance."""
    state = np.asarray(state, np.uint8)
    distance = np.where(state == SectorState.OBSTACLE, distance_m, np.nan).astype(np.float32)
    return ObstacleScan(distance, state, sector_bearings_deg(), nearest, farthest)


def single(bearing_deg: float, distance_m: float, rest: int = SectorState.CLEAR) -> ObstacleScan:
    """One obstacle; everything else is `rest`."""
    state = np.full(72, rest, np.uint8)
    state[round((bearing_deg + 155) / 5) % 72] = SectorState.OBSTACLE
    return scan_of(distance_m, state)


def _any_scan(seed: int) -> ObstacleScan:
    rng = np.random.default_rng(seed)
    share_unknown, share_clear = sorted(rng.random(2))
    kind = np.searchsorted([share_unknown, share_clear], rng.random(72))
    run = int(rng.choice([1, 3, 9]))  # neighbours often say the same
    return scan_of(rng.uniform(0.0, 19.5, 72), np.repeat(kind[::run], run)[:72])


scans = st.integers(0, 2**32 - 1).map(_any_scan)
"""Scans with any state in any element. From seeds: drawing 144 numbers one by one takes ten times as long."""
