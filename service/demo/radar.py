"""The sector radar: a scan drawn as seen from above, nose up."""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from uavdepth.scan.obstacle_scan import SECTOR_WIDTH_DEG, ObstacleScan, SectorState

BACKGROUND_BGR = (32, 28, 26)
RING_BGR = (88, 82, 78)
TEXT_BGR = (235, 235, 235)
CLEAR_BGR = (150, 122, 60)
UNKNOWN_BGR = (58, 54, 52)
OBSTACLE_BGR = (40, 130, 240)
"""Blue, grey and orange stay apart for every common colour blindness; the states differ in shape too."""

_SUPERSAMPLE = 2


def draw_radar(scan: ObstacleScan | None, size_px: int, ring_step_m: float = 5.0) -> NDArray[np.uint8]:
    """Draw a scan from above, nose up, distances linear from the centre.

    Args:
        scan: the scan, or None to draw "no data".
        size_px: width and height of the picture in pixels.
        ring_step_m: distance between the rings in metres.

    Returns:
        (size_px, size_px, 3) uint8 BGR: orange from an obstacle outwards, blue where the way is clear,
        hatched grey where nothing is known.
    """
    side = size_px * _SUPERSAMPLE
    picture = np.full((side, side, 3), BACKGROUND_BGR, np.uint8)
    centre = (side // 2, int(side * 0.56))
    radius = int(side * 0.42)
    if scan is None:
        _label(picture, "no data", (centre[0], centre[1]), 1.2)
        return _shrink(picture, size_px)
    for bearing, distance, state in zip(scan.bearing_deg, scan.distance_m, scan.state, strict=True):
        reach = float(distance) / scan.max_distance_m
        _draw_sector(picture, centre, radius, float(bearing), reach, int(state))
    _hatch_unknown(picture)
    for ring_m in np.arange(ring_step_m, scan.max_distance_m + 0.1, ring_step_m):
        ring_px = int(radius * ring_m / scan.max_distance_m)
        cv2.circle(picture, centre, ring_px, RING_BGR, 2, cv2.LINE_AA)
        offset = int(ring_px * 0.707)
        _label(picture, f"{ring_m:.0f} m", (centre[0] + offset + 6, centre[1] + offset), 0.8)
    _draw_vehicle(picture, centre, side)
    nearest = scan.nearest_m
    text = f"nearest {nearest:.1f} m" if nearest is not None else "no obstacle seen"
    _label(picture, text, (centre[0], int(side * 0.055)), 1.1)
    return _shrink(picture, size_px)


def _draw_sector(
    picture: NDArray[np.uint8],
    centre: tuple[int, int],
    radius: int,
    bearing_deg: float,
    reach: float,
    state: int,
) -> None:
    # OpenCV measures ellipse angles clockwise from the picture's x axis; the nose points up.
    start = bearing_deg - SECTOR_WIDTH_DEG / 2 - 90
    end = start + SECTOR_WIDTH_DEG
    axes = (radius, radius)
    if state == SectorState.CLEAR:
        cv2.ellipse(picture, centre, axes, 0, start, end, CLEAR_BGR, -1, cv2.LINE_AA)
    elif state == SectorState.OBSTACLE:
        inner = int(radius * min(reach, 1.0))
        cv2.ellipse(picture, centre, axes, 0, start, end, OBSTACLE_BGR, -1, cv2.LINE_AA)
        cv2.ellipse(picture, centre, (inner, inner), 0, start, end, CLEAR_BGR, -1, cv2.LINE_AA)
    else:
        cv2.ellipse(picture, centre, axes, 0, start, end, UNKNOWN_BGR, -1, cv2.LINE_AA)


def _hatch_unknown(picture: NDArray[np.uint8]) -> None:
    rows, columns = np.indices(picture.shape[:2])
    stripes = (rows + columns) % 24 < 3
    unknown = np.all(picture == UNKNOWN_BGR, axis=-1)
    picture[stripes & unknown] = RING_BGR


def _draw_vehicle(picture: NDArray[np.uint8], centre: tuple[int, int], side: int) -> None:
    size = side * 0.022
    corners = [(0.0, -1.6), (1.0, 1.0), (0.0, 0.45), (-1.0, 1.0)]
    outline = np.array([(centre[0] + x * size, centre[1] + y * size) for x, y in corners], np.int32)
    cv2.fillPoly(picture, [outline], TEXT_BGR, cv2.LINE_AA)


def _label(picture: NDArray[np.uint8], text: str, centre: tuple[int, int], scale: float) -> None:
    thickness = max(1, math.ceil(scale * 2))
    (width, height), _ = cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, scale, thickness)
    origin = (centre[0] - width // 2, centre[1] + height // 2)
    cv2.putText(picture, text, origin, cv2.FONT_HERSHEY_SIMPLEX, scale, TEXT_BGR, thickness, cv2.LINE_AA)


def _shrink(picture: NDArray[np.uint8], size_px: int) -> NDArray[np.uint8]:
    return np.asarray(cv2.resize(picture, (size_px, size_px), interpolation=cv2.INTER_AREA), np.uint8)
