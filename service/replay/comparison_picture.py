"""A comparison as a picture: time downwards, bearing across; golden, now, and where they differ."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from service.errors import RecordError
from service.replay.comparison import Comparison
from service.replay.golden import Golden, GoldenScan
from uavdepth.scan.obstacle_scan import SECTOR_COUNT, SectorState, sector_bearings_deg

_FAR_M = 20.0
_CELL = 6
_GAP = 16
_TOP = 44
_CLEAR_BGR, _UNKNOWN_BGR, _DIFFERS_BGR = (110, 60, 20), (70, 70, 70), (60, 60, 255)
_MAX_ROWS = 2000


def save_comparison(path: Path, golden: Golden, now: Sequence[GoldenScan], comparison: Comparison) -> None:
    """Write the picture as PNG or JPEG, by the name's ending.

    Raises:
        RecordError: it cannot be written.
    """
    picture = comparison_picture(golden, now, comparison)
    try:
        written, data = cv2.imencode(path.suffix or ".png", picture)
        if not written:
            raise RecordError(f"picture {path}: cannot be encoded")
        path.write_bytes(data.tobytes())
    except cv2.error as error:
        raise RecordError(f"picture {path}: {path.suffix!r} is no picture format: .png or .jpg") from error
    except OSError as error:
        raise RecordError(f"picture {path}: cannot be written: {error.strerror}") from error


def comparison_picture(
    golden: Golden, now: Sequence[GoldenScan], comparison: Comparison
) -> NDArray[np.uint8]:
    """(H, W, 3) uint8 BGR: bright is near, blue is clear, grey is unknown, red differs."""
    old_of, new_of = {s.index: s for s in golden.scans}, {s.index: s for s in now}
    both = sorted(old_of.keys() & new_of.keys())[:_MAX_ROWS]
    order = np.argsort((sector_bearings_deg() + 180.0) % 360.0)
    before = np.array([_row(old_of[index]) for index in both], np.uint8).reshape(-1, SECTOR_COUNT, 3)
    after = np.array([_row(new_of[index]) for index in both], np.uint8).reshape(-1, SECTOR_COUNT, 3)
    differs = after // 3
    differs[comparison.changed[: len(both)]] = _DIFFERS_BGR
    for row, index in enumerate(both):
        if (old_of[index].trouble is None) != (new_of[index].trouble is None):
            differs[row] = _DIFFERS_BGR
    panels = []
    for words, panel in (("golden", before), ("now", after), ("differs (red)", differs)):
        large = np.repeat(np.repeat(panel[:, order], _CELL, axis=1), _CELL // 2, axis=0)
        drawn = cv2.copyMakeBorder(large, _TOP, 4, 0, _GAP, cv2.BORDER_CONSTANT, value=(0, 0, 0))
        cv2.putText(drawn, words, (4, 16), cv2.FONT_HERSHEY_SIMPLEX, 0.5, (255, 255, 255), 1, cv2.LINE_AA)
        width = SECTOR_COUNT * _CELL
        for label, x in (("-180", 4), ("nose", width // 2 - 16), ("+180 deg", width - 64)):
            cv2.putText(drawn, label, (x, 36), cv2.FONT_HERSHEY_SIMPLEX, 0.4, (200, 200, 200), 1, cv2.LINE_AA)
        panels.append(drawn)
    return np.asarray(np.hstack(panels), np.uint8)


def _row(scan: GoldenScan) -> NDArray[np.uint8]:
    """(72, 3) colours of a scan."""
    near = np.clip(1.0 - scan.distance_m / _FAR_M, 0.15, 1.0)
    row = np.zeros((SECTOR_COUNT, 3), np.uint8)
    obstacle = scan.state == SectorState.OBSTACLE
    row[obstacle] = (255 * near[obstacle, None]).astype(np.uint8)
    row[scan.state == SectorState.CLEAR] = _CLEAR_BGR
    row[scan.state == SectorState.UNKNOWN] = _UNKNOWN_BGR
    return row
