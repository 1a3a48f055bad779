"""What was seen a moment ago and is not seen now: kept for half a second, carried along with the vehicle."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from uavdepth.errors import ScanError
from uavdepth.scan.motion import PlanarPose, moved_scans
from uavdepth.scan.obstacle_scan import ObstacleScan, SectorState

LONGEST_MEMORY_S = 0.5
"""PX4 forgets a bin after as long; what is older is not evidence in a world that moves."""

_FRAMES_IN_A_ROW = 2
"""An obstacle that stood in so many scans before is kept through one scan that misses it."""

_SPACING_NS = 120_000_000
"""Older scans are kept this far apart: what leaves the view between two of them is in the first."""

_SAME_THING = 1.3
"""Ratio of distances up to which two frames speak of the same thing: flicker is +-20 %, less what the nearest
of many points averages out."""

_LEAST_DEG = 2.0
"""An obstacle that is carried is told in elements that hold so much of its arc. A turn would otherwise make
each one two elements wide, and half of that a direction in which nothing was seen."""

_PASSED_M = 0.05
"""An obstacle that the vehicle has come to by dead reckoning, and through, was none in its way."""

_FASTEST_MPS = 60.0
_FASTEST_TURN_RADPS = math.radians(1080.0)


@dataclass(frozen=True)
class _Remembered:
    """One scan as it was taken, never one that memory has added to: so nothing outlives its time."""

    scan: ObstacleScan
    pose: PlanarPose
    at_ns: int


class ScanMemory:
    """Adds to a scan the obstacles that the scans before it saw. One thread; reads no clock.

    - Where the new scan says UNKNOWN, an obstacle that was seen there last stays where it stood.
    - Where it says CLEAR, or sees only something farther, an obstacle that both scans before it saw is kept
      through this one scan: a wire flickers. It is not kept if the new scan sees it beside.

    Memory adds obstacles and nothing else: it never makes an element clear, and never unknown.

    Do not merge a scan that is unknown because perception as a whole is not trusted; call `clear` instead.

    Args:
        memory_s: age at which a scan is forgotten, 0 to 0.5; 0 switches memory off.

    Raises:
        ScanError: another age.
    """

    def __init__(self, memory_s: float = LONGEST_MEMORY_S) -> None:
        if not 0.0 <= memory_s <= LONGEST_MEMORY_S:
            raise ScanError(f"memory_s is {memory_s}: 0 to {LONGEST_MEMORY_S:g} s is needed")
        self._memory_ns = round(memory_s * 1e9)
        self._kept: deque[_Remembered] = deque()

    def clear(self) -> None:
        """Forget everything."""
        self._kept.clear()

    def merge(self, scan: ObstacleScan, at_ns: int, pose: PlanarPose | None) -> ObstacleScan:
        """The scan with what memory knows, which then remembers the scan.

        Memory is forgotten when there is no pose, when time runs backwards, when the limits of the scan
        change, and when the pose jumps as no vehicle does (a reset of the autopilot's estimate).

        Args:
            scan: as the scanner made it.
            at_ns: when its picture was taken.
            pose: the vehicle's at that moment; None: not known.
        """
        if pose is None or not self._memory_ns or not _is_finite(pose):
            self.clear()
            return scan
        self._forget(scan, at_ns, pose)
        distance, state = scan.distance_m.copy(), scan.state.copy()
        if self._kept:
            carried = _carried(list(reversed(self._kept)), pose)
            _fill_unknown(distance, state, carried)
            if len(carried) >= _FRAMES_IN_A_ROW:
                _bridge(scan, distance, state, carried[:_FRAMES_IN_A_ROW])
        self._remember(_Remembered(scan, pose, at_ns))
        return replace(scan, distance_m=distance, state=state)

    def _forget(self, scan: ObstacleScan, at_ns: int, pose: PlanarPose) -> None:
        while self._kept and at_ns - self._kept[0].at_ns > self._memory_ns:
            self._kept.popleft()
        if not self._kept:
            return
        last = self._kept[-1]
        limits = (scan.min_distance_m, scan.max_distance_m)
        elapsed_s = (at_ns - last.at_ns) / 1e9
        if elapsed_s <= 0 or limits != (last.scan.min_distance_m, last.scan.max_distance_m):
            self.clear()
            return
        turned, way = last.pose.motion_to(pose)
        # The estimate is corrected in small steps all the time; they are allowed for.
        too_far = math.hypot(*way) > _FASTEST_MPS * elapsed_s + 1.0
        if too_far or abs(turned) > _FASTEST_TURN_RADPS * elapsed_s + 0.2:
            self.clear()

    def _remember(self, new: _Remembered) -> None:
        """Keep the newest scans, and of the older ones those that are far enough apart."""
        self._kept.append(new)
        recent = [self._kept.pop() for _ in range(min(_FRAMES_IN_A_ROW, len(self._kept)))]
        if len(self._kept) > 1 and self._kept[-1].at_ns - self._kept[-2].at_ns < _SPACING_NS:
            self._kept.pop()
        self._kept.extend(reversed(recent))


def _is_finite(pose: PlanarPose) -> bool:
    return all(math.isfinite(value) for value in (pose.north_m, pose.east_m, pose.yaw_rad))


def _carried(kept: Sequence[_Remembered], pose: PlanarPose) -> list[ObstacleScan]:
    turned, ways = zip(*(one.pose.motion_to(pose) for one in kept), strict=True)
    carried = []
    for moved in moved_scans([one.scan for one in kept], turned, ways, _LEAST_DEG):
        with np.errstate(invalid="ignore"):
            passed = moved.distance_m <= _PASSED_M
        state = np.where(passed, np.uint8(SectorState.UNKNOWN), moved.state)
        distance = np.where(passed, np.float32(np.nan), moved.distance_m)
        carried.append(replace(moved, state=state, distance_m=distance))
    return carried


def _fill_unknown(
    distance: NDArray[np.float32], state: NDArray[np.uint8], carried: list[ObstacleScan]
) -> None:
    """Put obstacles where nothing is known, by the newest scan that knew anything of the element."""
    open_questions = state == SectorState.UNKNOWN
    for past in carried:
        obstacle = open_questions & (past.state == SectorState.OBSTACLE)
        distance[obstacle] = past.distance_m[obstacle]
        state[obstacle] = SectorState.OBSTACLE
        open_questions &= past.state == SectorState.UNKNOWN


def _bridge(
    scan: ObstacleScan,
    distance: NDArray[np.float32],
    state: NDArray[np.uint8],
    carried: list[ObstacleScan],
) -> None:
    """Put obstacles back that all of `carried` saw and the new scan lost."""
    stood = np.stack([past.state == SectorState.OBSTACLE for past in carried]).all(axis=0)
    past = np.stack([past.distance_m for past in carried]).astype(np.float32)
    past[:, ~stood] = np.nan
    steady = stood & (past.max(axis=0) <= _SAME_THING * past.min(axis=0))
    now = np.where(scan.state == SectorState.OBSTACLE, scan.distance_m, np.float32(np.inf))
    now = np.fmin(now, np.inf)
    nearest_round = np.minimum(np.minimum(np.roll(now, 1), now), np.roll(now, -1))
    lost = steady & (scan.state != SectorState.UNKNOWN) & (nearest_round > _SAME_THING * past[0])
    distance[lost] = past[0][lost]
    state[lost] = SectorState.OBSTACLE
