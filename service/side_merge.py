"""What further cameras saw, added to the main camera's scan: the same live and in replays."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import structlog

from service.health import SEVERITY_INFO, SEVERITY_WARNING
from service.perception_result import PerceptionResult
from service.pipeline import pose_of
from service.settings import Settings
from service.telemetry import Telemetry
from uavdepth.scan.merge import merge_scans
from uavdepth.scan.motion import moved_scan
from uavdepth.scan.obstacle_scan import ObstacleScan

log = structlog.get_logger()

_SETTLED_NS = 1_000_000_000
"""A side that is lost or back is told when it has been so for a second."""

_LARGEST_JUMP_M = 0.5
"""Positions that part further from the way that the velocity tells were reset in between."""


@dataclass
class _Side:
    result: PerceptionResult | None = None
    is_used: bool = True
    since_ns: int | None = None


class SideMerge:
    """The newest result of each side, moved by the way of the vehicle since and added to the main scan.

    A side that has nothing new enough to say is unknown, which is told, and does not silence the others.

    Args:
        settings: the configuration.
        say: takes a severity and a text for the pilot.
    """

    def __init__(self, settings: Settings, say: Callable[[int, str], None] = lambda _severity, _text: None):
        self._say = say
        self._max_age_ns = round(settings.autopilot.max_frame_age_s * 1e9)
        self._sides = {extra.name: _Side() for extra in settings.extra_camera}

    def put(self, name: str, result: PerceptionResult | None) -> None:
        """The newest of a side; None if it broke. May be called from the side's own thread."""
        self._sides[name].result = result

    def added_to(self, result: PerceptionResult) -> PerceptionResult:
        """The main camera's result with what the sides see; itself where it is not trusted."""
        if not self._sides or not result.trusted:
            return result
        scans = [result.scan]
        for name, side in self._sides.items():
            scan = self._scan_at(side.result, result)
            self._tell(name, side, result.captured_ns, is_used=scan is not None)
            if scan is not None:
                scans.append(scan)
        return replace(result, scan=merge_scans(scans))

    def _scan_at(self, seen: PerceptionResult | None, main: PerceptionResult) -> ObstacleScan | None:
        """What a side saw, as it is at the main picture's capture; None where it is no longer so."""
        if seen is None or not seen.trusted or abs(main.captured_ns - seen.captured_ns) > self._max_age_ns:
            return None
        here, then = pose_of(main.telemetry), pose_of(seen.telemetry)
        if here is None or then is None or _was_reset(seen.telemetry, main.telemetry):
            return None
        turned_rad, moved_m = then.motion_to(here)
        return moved_scan(seen.scan, turned_rad, moved_m)

    def _tell(self, name: str, side: _Side, now_ns: int, *, is_used: bool) -> None:
        """Tell the pilot of a side that is lost or back."""
        if is_used is side.is_used:
            side.since_ns = None
            return
        if side.since_ns is None or now_ns < side.since_ns:
            side.since_ns = now_ns
        if now_ns - side.since_ns < _SETTLED_NS:
            return
        side.is_used, side.since_ns = is_used, None
        state = "ON" if is_used else "OFF"
        result = side.result  # its thread may change it at any time
        trouble = None if result is None else result.trouble
        log.info(f"side camera {state}", camera=name, trouble=trouble and trouble.value)
        self._say(SEVERITY_INFO if is_used else SEVERITY_WARNING, f"uavdepth: camera {name} {state}")


def _was_reset(first: Telemetry, second: Telemetry) -> bool:
    """Whether the autopilot's positions jumped between two moments, or are those of another start."""
    if first.epoch != second.epoch:
        return True
    before, after = first.position_ned_m, second.position_ned_m
    start_mps, end_mps = first.velocity_ned_mps, second.velocity_ned_mps
    if before is None or after is None or start_mps is None or end_mps is None:
        return False
    half_s = 0.5e-9 * (second.at_ns - first.at_ns)
    flown = [half_s * (start + end) for start, end in zip(start_mps, end_mps, strict=True)]
    north_m, east_m = (after[axis] - before[axis] - flown[axis] for axis in (0, 1))
    return not math.hypot(north_m, east_m) <= _LARGEST_JUMP_M
