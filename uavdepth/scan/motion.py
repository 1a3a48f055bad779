"""A scan carried along: what it says after the vehicle has turned and moved on."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from uavdepth.errors import ScanError
from uavdepth.scan.obstacle_scan import (
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

_TOUCHED_SHARE = 0.4
"""Where an arc lies in two elements, so much of it is in one of them at least."""

_RANGES = 9
"""Ranges at which a direction is followed back into the old scan, evenly in 1/range: 2 degrees apart."""

_ROUNDING = 1e-9

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
    return moved_scans([scan], [turned_rad], [moved_level_m])[0]


def moved_scans(
    scans: Sequence[ObstacleScan],
    turned_rad: Sequence[float],
    moved_level_m: Sequence[tuple[float, float]],
    least_deg: float = _OVERLAP_DEG,
) -> list[ObstacleScan]:
    """`moved_scan` of several scans, each with its own turn and way, in little more time than one takes.

    Args:
        scans, turned_rad, moved_level_m: as for `moved_scan`.
        least_deg: an obstacle is told in elements that hold so much of its arc, or, of a narrower one, two
            fifths of it; from what touches an element up to 2 degrees of its 5.

    Raises:
        ScanError: a turn or a way that is not finite.
    """
    for turn, way in zip(turned_rad, moved_level_m, strict=True):
        if not all(math.isfinite(value) for value in (turn, *way)):
            raise ScanError(f"a turn of {turn} rad and a way of {way} m: both must be finite")
    turned_deg, ways = np.degrees(turned_rad), np.array(moved_level_m, dtype=np.float64)
    distances = _moved_obstacles(scans, turned_deg, ways, least_deg)
    clear = _still_clear(scans, turned_deg, ways)
    states = np.where(clear, SectorState.CLEAR, SectorState.UNKNOWN).astype(np.uint8)
    stands = np.isfinite(distances)
    states[stands] = SectorState.OBSTACLE
    distances = np.where(stands, distances, np.nan).astype(np.float32)
    return [
        replace(scan, distance_m=distance, state=state)
        for scan, distance, state in zip(scans, distances, states, strict=True)
    ]


def _moved_obstacles(
    scans: Sequence[ObstacleScan],
    turned_deg: NDArray[np.float64],
    ways: NDArray[np.float64],
    least_deg: float,
) -> NDArray[np.float64]:
    """(K, 72) nearest distance in each element, +inf where there is none."""
    distances, states = _stacked(scans)
    nearest = np.full(distances.shape, np.inf)
    with np.errstate(invalid="ignore"):
        known = np.isfinite(distances) & (distances >= 0) & (states == SectorState.OBSTACLE)
    number, told = np.nonzero(known)
    if not told.size:
        return nearest
    before, way = distances[number, told][:, None], ways[number]
    centres = sector_bearings_deg().astype(np.float64)[told][:, None]
    edges = centres + SECTOR_WIDTH_DEG * (np.arange(_PIECES + 1) / _PIECES - 0.5)
    moved = before[..., None] * _unit(edges) - way[:, None, :]
    bearing = edges + _wrapped(_bearing_deg(moved) - edges)
    reach = _nearest_of_arcs(before, edges, way)
    # A way that leads through an obstacle ends at it: it was nearer than it was told to be.
    length = np.hypot(way[:, 0], way[:, 1])[:, None]
    ahead = np.abs(_wrapped(centres - _bearing_deg(way)[:, None])) <= SECTOR_WIDTH_DEG / 2
    reach[(ahead & (length >= before))[:, 0]] = 0.0
    at_hand, turned = reach < _AT_HAND_M, turned_deg[number][:, None]
    low = np.where(at_hand, edges[:, :-1], np.minimum(bearing[:, :-1], bearing[:, 1:])) - turned
    high = np.where(at_hand, edges[:, 1:], np.maximum(bearing[:, :-1], bearing[:, 1:])) - turned
    farthest = np.array([scan.max_distance_m for scan in scans])[number][:, None]
    reach = np.minimum(reach, np.maximum(before, farthest - _BELOW_MAX_M))
    low, high = _element(low) + 0.5, _element(high) + 0.5
    overlap = _OVERLAP_DEG / SECTOR_WIDTH_DEG
    first, last = np.floor(low + overlap).astype(np.intp), np.floor(high - overlap).astype(np.intp)
    row = np.broadcast_to(np.arange(len(number))[:, None], first.shape)
    of_arc = np.full((len(number), SECTOR_COUNT), np.inf)
    inside = np.zeros_like(of_arc)
    for step in range(int((last - first).max(initial=0)) + 1):
        touched = first + step <= np.maximum(first, last)
        begin = (first + step)[touched]
        place = row[touched], begin % SECTOR_COUNT
        np.minimum.at(of_arc, place, reach[touched])
        np.add.at(inside, place, np.minimum(high[touched], begin + 1) - np.maximum(low[touched], begin))
    least = np.minimum(least_deg / SECTOR_WIDTH_DEG, _TOUCHED_SHARE * (high - low).sum(axis=1))
    of_arc[inside < np.maximum(least, 0.0)[:, None] - _ROUNDING] = np.inf
    np.minimum.at(nearest, number, of_arc)
    return nearest


def _nearest_of_arcs(
    radius: NDArray[np.float64], edges_deg: NDArray[np.float64], way: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(N, pieces) distance from each of (N, 2) ways to the nearest point of each piece of an arc."""
    length = np.hypot(way[:, 0], way[:, 1])[:, None]
    towards = _bearing_deg(way)[:, None]
    middle = (edges_deg[:, :-1] + edges_deg[:, 1:]) / 2
    half = SECTOR_WIDTH_DEG / _PIECES / 2
    off = np.deg2rad(np.maximum(np.abs(_wrapped(middle - towards)) - half, 0.0))
    squared = radius**2 + length**2 - 2 * radius * length * np.cos(off)
    return np.asarray(np.sqrt(np.maximum(squared, 0.0)), dtype=np.float64)


def _still_clear(
    scans: Sequence[ObstacleScan], turned_deg: NDArray[np.float64], ways: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """(K, 72) elements in which everything that they cross of the old scan was clear."""
    distances, states = _stacked(scans)
    clear = states == SectorState.CLEAR
    bearings = sector_bearings_deg().astype(np.float64) + turned_deg[:, None]
    most_m = np.array([scan.max_distance_m for scan in scans])
    farthest = ways[:, None, :] + most_m[:, None, None] * _unit(bearings)
    perhaps = np.take_along_axis(clear, _element_of(farthest), axis=1)
    number, element = np.nonzero(perhaps)
    if not number.size:
        return perhaps
    edge = SECTOR_WIDTH_DEG / 2 - _OVERLAP_DEG
    across = bearings[number, element][:, None] + np.linspace(-edge, edge, _PIECES)
    nearest_m = np.maximum(
        _NEAREST_WAYS * np.hypot(ways[:, 0], ways[:, 1]), [scan.min_distance_m for scan in scans]
    )
    nearest_m = np.minimum(nearest_m, _FARTHEST_SHARE * most_m)
    ranges = 1.0 / np.linspace(1.0 / most_m, 1.0 / nearest_m, _RANGES if ways.any() else 1, axis=1)
    points = ways[number][:, None, None, :] + ranges[number][:, :, None, None] * _unit(across)[:, None]
    crossed, of_scan = _element_of(points), number[:, None, None]
    # In front of its obstacle an element has been looked at; at it and behind it, nothing is known.
    free_m = np.where(states == SectorState.OBSTACLE, np.nan_to_num(distances, nan=0.0), 0.0)
    before = np.hypot(points[..., 0], points[..., 1]) < free_m[of_scan, crossed]
    perhaps[number, element] = (clear[of_scan, crossed] | before).all(axis=(1, 2))
    return perhaps


def _stacked(scans: Sequence[ObstacleScan]) -> tuple[NDArray[np.float64], NDArray[np.uint8]]:
    """(K, 72) distances and states."""
    distances = np.array([scan.distance_m for scan in scans], dtype=np.float64)
    return distances, np.array([scan.state for scan in scans], dtype=np.uint8)


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
