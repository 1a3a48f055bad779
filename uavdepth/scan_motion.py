"""A scan carried along: what it says after the vehicle has turned and moved on."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from uavdepth.errors import ScanError
from uavdepth.obstacle_scan import (
    FIRST_BEARING_DEG,
    SECTOR_COUNT,
    SECTOR_WIDTH_DEG,
    ObstacleScan,
    SectorState,
    sector_bearings_deg,
)

_PIECES = 5
"""An element's arc is moved in pieces of 1 degree, each at its own distance and bearing."""

_OVERLAP_DEG = 0.01
"""Elements that share less than this do not touch: rounding, not geometry."""

_NEAREST_WAYS = 4.0
"""Clear speaks of what lies further off than four times the way moved, seen from where the vehicle is now:
bearings have then changed by less than 15 degrees."""

_FARTHEST_SHARE = 0.5
"""But of all that lies beyond half of maximum distance, however long the way."""

_RANGES = 9
"""Ranges at which a direction is followed back into the old scan, evenly in 1/range: 2 degrees apart."""

_AT_HAND_M = 0.3
"""Within the vehicle a bearing means nothing: such an obstacle stays where it was seen."""

_BELOW_MAX_M = 0.02
"""An obstacle that recedes stays this much below maximum distance, where it would read as clear."""


@dataclass(frozen=True)
class PlanarPose:
    """Where the vehicle is and where its nose points, seen from above.

    Args:
        at_ns: the moment, nanoseconds on the service's clock.
        north_m, east_m: in the autopilot's local frame, metres.
        yaw_rad: heading of the nose, clockwise from north.
    """

    at_ns: int
    north_m: float
    east_m: float
    yaw_rad: float

    def motion_to(self, later: PlanarPose) -> tuple[float, tuple[float, float]]:
        """What `moved_scan` needs to take a scan from this pose to `later`.

        Returns:
            The turn clockwise, radians, from -pi to pi; the way forward and to the right in this pose's
            level frame, metres.
        """
        north, east = later.north_m - self.north_m, later.east_m - self.east_m
        cosine, sine = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        turned = math.remainder(later.yaw_rad - self.yaw_rad, math.tau)
        return turned, (cosine * north + sine * east, cosine * east - sine * north)


def moved_scan(scan: ObstacleScan, turned_rad: float, moved_level_m: tuple[float, float]) -> ObstacleScan:
    """The scan as seen after the vehicle has turned and moved; what it saw has stood still.

    An obstacle is somewhere on its element's arc, so it is told in every element that the moved arc touches,
    at the nearest distance there. An element is clear where all of it was clear before: each element of the
    old scan that it crosses, up to the obstacle there, beyond four times the way moved or half of maximum
    distance, whichever is nearer. The last bit before
    maximum distance, as long as the way moved, is new and taken for what lies before it.

    Each move widens obstacles by up to an element: move the scan as it was taken, not one that was moved.

    Args:
        scan: as it was taken.
        turned_rad: turn of the nose since then, clockwise seen from above.
        moved_level_m: way since then, forward and right in the level frame that the scan was taken in.

    Returns:
        A scan with the same limits. Distances are at least 0; an obstacle that the way leads through stays
        where it was seen, at 0 m. Nothing is clear whose direction was not.

    Raises:
        ScanError: a turn or a way that is not finite.
    """
    forward, right = moved_level_m
    if not all(math.isfinite(value) for value in (turned_rad, forward, right)):
        raise ScanError(f"a turn of {turned_rad} rad and a way of {moved_level_m} m: both must be finite")
    way = np.array([forward, right], dtype=np.float64)
    turned_deg = math.degrees(turned_rad)
    distance = _moved_obstacles(scan, turned_deg, way)
    clear = _still_clear(scan, turned_deg, way)
    state = np.where(clear, SectorState.CLEAR, SectorState.UNKNOWN).astype(np.uint8)
    state[np.isfinite(distance)] = SectorState.OBSTACLE
    distance[~np.isfinite(distance)] = np.nan
    return replace(scan, distance_m=distance.astype(np.float32), state=state)


def _moved_obstacles(scan: ObstacleScan, turned_deg: float, way: NDArray[np.float64]) -> NDArray[np.float64]:
    """(72,) nearest distance in each element, +inf where there is none."""
    nearest = np.full(SECTOR_COUNT, np.inf)
    known = np.isfinite(scan.distance_m) & (scan.distance_m >= 0)
    told = np.flatnonzero((scan.state == SectorState.OBSTACLE) & known)
    if not told.size:
        return nearest
    before = scan.distance_m[told].astype(np.float64)[:, None]
    centres = scan.bearing_deg[told].astype(np.float64)[:, None]
    edges = centres + SECTOR_WIDTH_DEG * (np.arange(_PIECES + 1) / _PIECES - 0.5)
    bearing = edges + _wrapped(_bearing_deg(before[..., None] * _unit(edges) - way) - edges)
    reach = _nearest_of_arcs(before, edges, way)
    # A way that leads through an obstacle ends at it: it was nearer than it was told to be.
    ahead = np.abs(_wrapped(centres - _bearing_deg(way))) <= SECTOR_WIDTH_DEG / 2
    reach[(ahead & (float(np.hypot(*way)) >= before))[:, 0]] = 0.0
    at_hand = reach < _AT_HAND_M
    low = np.where(at_hand, edges[:, :-1], np.minimum(bearing[:, :-1], bearing[:, 1:])) - turned_deg
    high = np.where(at_hand, edges[:, 1:], np.maximum(bearing[:, :-1], bearing[:, 1:])) - turned_deg
    reach = np.minimum(reach, np.maximum(before, scan.max_distance_m - _BELOW_MAX_M))
    overlap = _OVERLAP_DEG / SECTOR_WIDTH_DEG
    first = np.floor(_element(low) + 0.5 + overlap).astype(np.intp)
    last = np.floor(_element(high) + 0.5 - overlap).astype(np.intp)
    for step in range(int((last - first).max(initial=0)) + 1):
        touched = first + step <= np.maximum(first, last)
        np.minimum.at(nearest, (first[touched] + step) % SECTOR_COUNT, reach[touched])
    return nearest


def _nearest_of_arcs(
    radius: NDArray[np.float64], edges_deg: NDArray[np.float64], way: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(N, pieces) distance from `way` to the nearest point of each piece of an arc round the origin."""
    length = float(np.hypot(*way))
    towards = math.degrees(math.atan2(way[1], way[0]))
    middle = (edges_deg[:, :-1] + edges_deg[:, 1:]) / 2
    half = SECTOR_WIDTH_DEG / _PIECES / 2
    off = np.deg2rad(np.maximum(np.abs(_wrapped(middle - towards)) - half, 0.0))
    squared = radius**2 + length**2 - 2 * radius * length * np.cos(off)
    return np.asarray(np.sqrt(np.maximum(squared, 0.0)), dtype=np.float64)


def _still_clear(scan: ObstacleScan, turned_deg: float, way: NDArray[np.float64]) -> NDArray[np.bool_]:
    """(72,) elements in which everything that they cross of the old scan was clear."""
    clear = scan.state == SectorState.CLEAR
    bearings = sector_bearings_deg().astype(np.float64)[:, None] + turned_deg
    farthest = way + scan.max_distance_m * _unit(bearings)
    perhaps = np.asarray(clear[_element_of(farthest)][:, 0], dtype=np.bool_)
    if not perhaps.any():
        return perhaps
    edge = SECTOR_WIDTH_DEG / 2 - _OVERLAP_DEG
    across = bearings[perhaps] + np.linspace(-edge, edge, _PIECES)
    nearest = max(_NEAREST_WAYS * float(np.hypot(*way)), scan.min_distance_m)
    nearest = min(nearest, _FARTHEST_SHARE * scan.max_distance_m)
    ranges = 1.0 / np.linspace(1.0 / scan.max_distance_m, 1.0 / nearest, _RANGES if way.any() else 1)
    points = way + ranges[:, None] * _unit(across)[:, :, None, :]
    element = _element_of(points)
    # In front of its obstacle an element has been looked at; at it and behind it, nothing is known.
    free_m = np.where(scan.state == SectorState.OBSTACLE, np.nan_to_num(scan.distance_m, nan=0.0), 0.0)
    free = clear[element] | (np.hypot(points[..., 0], points[..., 1]) < free_m[element])
    perhaps[perhaps] = free.all(axis=(1, 2))
    return perhaps


def _element_of(points: NDArray[np.float64]) -> NDArray[np.intp]:
    """Number of the element that holds each of (..., 2) points."""
    return np.floor(_element(_bearing_deg(points)) + 0.5).astype(np.intp) % SECTOR_COUNT


def _unit(bearing_deg: NDArray[np.float64]) -> NDArray[np.float64]:
    """(..., 2) forward and right of directions."""
    radians = np.deg2rad(bearing_deg)
    return np.stack([np.cos(radians), np.sin(radians)], axis=-1)


def _bearing_deg(points: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(np.rad2deg(np.arctan2(points[..., 1], points[..., 0])), dtype=np.float64)


def _element(bearing_deg: NDArray[np.float64]) -> NDArray[np.float64]:
    """Element number of a bearing, not rounded and not wrapped; whole at the centres."""
    return (bearing_deg - FIRST_BEARING_DEG) / SECTOR_WIDTH_DEG


def _wrapped(degrees: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray((degrees + 180.0) % 360.0 - 180.0, dtype=np.float64)
