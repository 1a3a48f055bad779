"""Further cameras, each measured in a thread of its own; their scans are added to the main camera's."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Protocol

import structlog

from service.cameras.camera import Camera
from service.cameras.reader import CameraReader
from service.cameras.rendered import PoseSource
from service.cameras.source import make_camera
from service.clock import Clock
from service.frame import Frame
from service.health import SEVERITY_INFO, SEVERITY_WARNING
from service.latest_slot import LatestSlot
from service.perception_result import PerceptionResult
from service.pipeline import Perception, pose_of
from service.settings import ExtraCameraSettings, Settings
from service.telemetry import Telemetry
from uavdepth.obstacle_scan import ObstacleScan
from uavdepth.scan_merge import merge_scans
from uavdepth.scan_motion import moved_scan

log = structlog.get_logger()

_TAKE_S = 0.1
_JOIN_TIMEOUT_S = 3.0
_SETTLED_NS = 1_000_000_000
"""A side that is lost or back is told when it has been so for a second."""

_LARGEST_JUMP_M = 0.5
"""Positions that part further from the way that the velocity tells were reset in between."""


class SideLink(PoseSource, Protocol):
    """What side cameras need of the autopilot link."""

    def say(self, severity: int, text: str) -> None: ...


@dataclass
class _Side:
    """One further camera; the thread of its own writes `result`, which is read as it is."""

    name: str
    settings: Settings
    reader: CameraReader
    frames: LatestSlot[Frame]
    result: PerceptionResult | None = None
    is_used: bool = True
    since_ns: int | None = None


class SideCameras:
    """Cameras beside the main one; without any in the configuration it does nothing.

    Every obstacle message replaces the whole circle, so there is one for all cameras, at the pace of the main
    one: to its scan the newest of each side is added, moved by the way of the vehicle in between. A side
    that has nothing new enough to say is unknown, which is told to the pilot, and does not silence the
    others; a main camera that is in trouble silences all.

    Args:
        settings: the configuration.
        clock: the service's.
        link: where the vehicle is.
        open_camera: makes a camera that is not opened yet.

    Raises:
        ConfigError: a source that is not understood or does not exist.
    """

    def __init__(
        self,
        settings: Settings,
        clock: Clock,
        link: SideLink,
        open_camera: Callable[[ExtraCameraSettings], Camera] | None = None,
    ) -> None:
        self._link = link
        self._max_age_ns = round(settings.autopilot.max_frame_age_s * 1e9)
        self._stopping = threading.Event()
        self._sides: list[_Side] = []
        self._threads: list[threading.Thread] = []
        for extra in settings.extra_camera:
            if open_camera is not None:
                camera = open_camera(extra)
            else:
                camera = make_camera(extra.camera.source, extra.camera, clock, link, extra.mount.mount)
            frames: LatestSlot[Frame] = LatestSlot()
            own = settings.model_copy(update={"camera": extra.camera, "mount": extra.mount})
            self._sides.append(_Side(extra.name, own, CameraReader(camera, frames), frames))

    def start(self, main: Perception) -> None:
        """Begin to read and measure, with the main camera's network.

        Raises:
            ConfigError: a mask that does not fit its camera.
        """
        made = [(side, main.beside(side.settings)) for side in self._sides]
        for side, perception in made:
            thread = threading.Thread(
                target=self._perceive, args=(side, perception), name=f"side {side.name}", daemon=True
            )
            self._threads.append(thread)
            side.reader.start()
            thread.start()

    def stop(self) -> None:
        """Stop and close the cameras."""
        self._stopping.set()
        for side in self._sides:
            side.frames.close()
            side.reader.stop()
        for thread in self._threads:
            thread.join(_JOIN_TIMEOUT_S)

    def added_to(self, result: PerceptionResult) -> PerceptionResult:
        """The main camera's result with what the sides see; itself where it is not trusted."""
        if not self._sides or not result.trusted:
            return result
        scans = [result.scan]
        for side in self._sides:
            scan = self._scan_at(side.result, result)
            self._tell(side, result.captured_ns, is_used=scan is not None)
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

    def _tell(self, side: _Side, now_ns: int, *, is_used: bool) -> None:
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
        log.info(f"side camera {state}", camera=side.name, trouble=trouble and trouble.value)
        self._link.say(
            SEVERITY_INFO if is_used else SEVERITY_WARNING, f"uavdepth: camera {side.name} {state}"
        )

    def _perceive(self, side: _Side, perception: Perception) -> None:
        while not self._stopping.is_set():
            frame = side.frames.take(_TAKE_S)
            if frame is None:
                continue
            try:
                side.result = perception.step_late(frame, self._link.telemetry_at)
            except Exception:
                side.result = None
                log.exception("a side camera's perception broke", camera=side.name, frame=frame.index)


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
