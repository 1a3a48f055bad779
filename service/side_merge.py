"""What further cameras saw, added to the main camera's scan: the same live and in replays."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from service.perception_result import PerceptionResult
from service.pipeline import pose_of
from service.position_jump import has_jumped
from service.settings import Settings
from service.trouble import Trouble
from uavdepth.scan.merge import merge_scans
from uavdepth.scan.motion import moved_scan
from uavdepth.scan.obstacle_scan import ObstacleScan


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
        if here is None or then is None or has_jumped(seen.telemetry, main.telemetry):
            return Trouble.NO_POSITION
        turned_rad, moved_m = then.motion_to(here)
        reset_rad = main.telemetry.heading_shift_rad - seen.telemetry.heading_shift_rad
        return moved_scan(seen.scan, turned_rad - reset_rad, moved_m)
