"""Several cameras, one scan: every message replaces the whole circle, so there can only be one."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from uavdepth.errors import ScanError
from uavdepth.scan.obstacle_scan import SECTOR_COUNT, ObstacleScan, SectorState


def merge_scans(scans: Sequence[ObstacleScan]) -> ObstacleScan:
    """One scan of what several cameras see at one moment.

    Element by element:
    - OBSTACLE where any camera sees one, at the smallest distance;
    - CLEAR where at least one camera says so, and none sees an obstacle. That is enough, because a camera
      says CLEAR only of an element that it sees in full, from edge to edge and over the band's height: a
      camera that sees a part of an element says UNKNOWN, and two halves never add up to CLEAR here;
    - UNKNOWN else. An obstacle without a usable distance is doubt, which no other camera's CLEAR lifts.

    Scans of different moments have to be brought to one first (`uavdepth.scan.motion.moved_scan`).

    Args:
        scans: at least one, all with the same limits.

    Raises:
        ScanError: no scan, arrays that are not 72 long, or limits that differ: the autopilot must be told one
            min_distance and one max_distance for the whole flight.
    """
    if not scans:
        raise ScanError("no scan to merge: at least 1 is needed")
    first = scans[0]
    for scan in scans:
        if (scan.min_distance_m, scan.max_distance_m) != (first.min_distance_m, first.max_distance_m):
            raise ScanError(
                f"scans of {first.min_distance_m} to {first.max_distance_m} m and of "
                f"{scan.min_distance_m} to {scan.max_distance_m} m cannot be merged: the limits must be equal"
            )
        for name, values in (("distance_m", scan.distance_m), ("state", scan.state)):
            if np.shape(values) != (SECTOR_COUNT,):
                raise ScanError(f"{name} has the shape {np.shape(values)}: ({SECTOR_COUNT},) is needed")
    state = np.stack([scan.state for scan in scans])
    distance = np.stack([scan.distance_m for scan in scans]).astype(np.float32)
    claimed = state == SectorState.OBSTACLE
    located = claimed & (distance >= 0)  # NaN is not at any distance

    nearest = np.where(located, distance, np.float32(np.inf)).min(axis=0)
    obstacle = located.any(axis=0)
    clear = (state == SectorState.CLEAR).any(axis=0) & ~claimed.any(axis=0)
    merged = np.where(clear, SectorState.CLEAR, SectorState.UNKNOWN).astype(np.uint8)
    merged[obstacle] = SectorState.OBSTACLE
    nearest[~obstacle] = np.nan
    return ObstacleScan(nearest, merged, first.bearing_deg, first.min_distance_m, first.max_distance_m)
