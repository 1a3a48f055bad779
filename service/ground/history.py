"""How near the nearest obstacle was over the last minutes."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from enum import IntEnum
from typing import Final

from service.publisher.wire import ScanSample

HISTORY_S: Final = 120
STEP_NS: Final = 250_000_000


class Verdict(IntEnum):
    """What a whole scan says of the way ahead."""

    UNKNOWN = 0
    """Nothing is known anywhere, or the scan is not trusted."""
    CLEAR = 1
    """No obstacle where it sees."""
    OBSTACLE = 2


@dataclass(frozen=True)
class Reading:
    """One scan in short.

    Args:
        verdict: what it says.
        nearest_cm: distance of the nearest obstacle, centimetres; -1 unless the verdict is OBSTACLE.
        bearing_deg: of that obstacle, -180 to 180 clockwise from the nose; 0 if there is none.
    """

    verdict: Verdict
    nearest_cm: int = -1
    bearing_deg: float = 0.0


def reading_of(scan: ScanSample) -> Reading:
    """A scan in short."""
    if not scan.trusted or ("1" not in scan.state and "2" not in scan.state):
        return Reading(Verdict.UNKNOWN)
    if "2" not in scan.state:
        return Reading(Verdict.CLEAR)
    nearest_cm, index = min((cm, index) for index, cm in enumerate(scan.distance_cm) if cm >= 0)
    bearing_deg = (scan.first_bearing_deg + index * scan.step_deg + 180.0) % 360.0 - 180.0
    return Reading(Verdict.OBSTACLE, nearest_cm, bearing_deg)


@dataclass(frozen=True)
class HistoryPoint:
    """The worst of a quarter of a second: the nearest obstacle, else unknown, else clear.

    Args:
        captured_ns: when, on the viewer's clock.
        verdict: what the scans said.
        nearest_cm: the least distance, -1 unless the verdict is OBSTACLE.
    """

    captured_ns: int
    verdict: Verdict
    nearest_cm: int


_GRAVITY = {Verdict.CLEAR: 0, Verdict.UNKNOWN: 1, Verdict.OBSTACLE: 2}


class NearestHistory:
    """Two minutes in quarters of a second. A pause leaves no points: nothing is drawn through it."""

    def __init__(self) -> None:
        self._points: deque[HistoryPoint] = deque(maxlen=HISTORY_S * 1_000_000_000 // STEP_NS)

    def hear(self, reading: Reading, captured_ns: int) -> None:
        """Take one scan, captured at that time on the viewer's clock."""
        point = HistoryPoint(captured_ns, reading.verdict, reading.nearest_cm)
        if self._points and self._points[-1].captured_ns // STEP_NS == captured_ns // STEP_NS:
            point = _worse(self._points.pop(), point)
        self._points.append(point)

    def points(self, now_ns: int) -> list[HistoryPoint]:
        """The points of the last two minutes, oldest first."""
        begin_ns = now_ns - HISTORY_S * 1_000_000_000
        return [point for point in self._points if point.captured_ns >= begin_ns]


def _worse(one: HistoryPoint, other: HistoryPoint) -> HistoryPoint:
    if one.verdict is other.verdict is Verdict.OBSTACLE:
        return one if one.nearest_cm <= other.nearest_cm else other
    return one if _GRAVITY[one.verdict] >= _GRAVITY[other.verdict] else other
