"""What further cameras saw, added to the main camera's scan: the same live and in replays."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

from service.perception_result import PerceptionResult
from service.pipeline import pose_of
from service.settings import Settings
from service.telemetry import Telemetry
from service.trouble import Trouble
from uavdepth.scan.merge import merge_scans
from uavdepth.scan.motion import moved_scan
from uavdepth.scan.obstacle_scan import ObstacleScan

_LARGEST_JUMP_M = 0.5
"""Positions that part further from the way that the velocity tells were reset in between."""


class SideMerge:
    """The newest result of each side, moved by the way of the vehicle since and added to the main scan.

    A side that has nothing new enough to say is unknown, and does not silence the others.

    Args:
        settings: the configuration.
    """

    def __init__(self, settings: Settings) -> None:
        self._max_age_ns = round(settings.autopilot.max_frame_age_s * 1e9)
        self._results: dict[str, PerceptionResult | None] = {
            extra.name: None for extra in settings.extra_camera
        }
        self.used_ns: Mapping[str, int] = {}
        """The sides in the last merged scan, and when their pictures were taken."""
        self.left_out: Mapping[str, Trouble] = {}
        """The sides that are not in it, and why."""

    def put(self, name: str, result: PerceptionResult | None) -> None:
        """The newest of a side; None if it broke. May be called from the side's own thread."""
        self._results[name] = result

    def added_to(self, result: PerceptionResult) -> PerceptionResult:
        """The main camera's result with what the sides see; itself where it is not trusted."""
        if not self._results or not result.trusted:
            return result
        scans, used_ns, left_out = [result.scan], {}, {}
        for name, seen in tuple(self._results.items()):
            if seen is None:
                left_out[name] = Trouble.STALLED
                continue
            scan = self._scan_at(seen, result)
            if isinstance(scan, Trouble):
                left_out[name] = scan
            else:
                scans.append(scan)
                used_ns[name] = seen.captured_ns
        self.used_ns, self.left_out = used_ns, left_out
        return replace(result, scan=merge_scans(scans))

    def _scan_at(self, seen: PerceptionResult, main: PerceptionResult) -> ObstacleScan | Trouble:
        """What a side saw, as it is at the main picture's capture, or why it is not known to be so."""
        if seen.trouble is not None:
            return seen.trouble
        if abs(main.captured_ns - seen.captured_ns) > self._max_age_ns:
            return Trouble.STALE_FRAME
        here, then = pose_of(main.telemetry), pose_of(seen.telemetry)
        if here is None or then is None or _was_reset(seen.telemetry, main.telemetry):
            return Trouble.NO_POSITION
        turned_rad, moved_m = then.motion_to(here)
        return moved_scan(seen.scan, turned_rad, moved_m)


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
