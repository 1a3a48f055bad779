"""Further cameras, each measured in a thread of its own; their scans are added to the main camera's."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import structlog

from service.cameras.camera import Camera
from service.cameras.reader import CameraReader
from service.cameras.rendered import PoseSource
from service.cameras.source import make_camera
from service.clock import Clock
from service.frame import Frame
from service.health import SEVERITY_WARNING
from service.hold_on_loss import Sight
from service.latest_slot import LatestSlot
from service.perception_result import PerceptionResult
from service.pipeline import Perception
from service.settings import ExtraCameraSettings, Settings
from service.side_merge import SideMerge
from service.side_watch import SideLoss, SideWatch
from service.status import SideStatus
from uavdepth.errors import UavDepthError

log = structlog.get_logger()

_TAKE_S = 0.1
_JOIN_TIMEOUT_S = 3.0

Record = Callable[[PerceptionResult, int, int, str], None]
"""Takes a side's result, when its measurement began and ended, and the side's name."""


class SideLink(PoseSource, Protocol):
    """What side cameras need of the autopilot link."""

    def say(self, severity: int, text: str) -> None: ...


@dataclass
class _Side:
    """One further camera."""

    name: str
    settings: Settings
    reader: CameraReader
    frames: LatestSlot[Frame]
    watch: SideWatch
    perception: Perception | None = None


class SideCameras:
    """Cameras beside the main one; without any in the configuration it does nothing.

    Every obstacle message replaces the whole circle, so there is one for all cameras, at the pace of the main
    one: see `SideMerge`. A main camera that is in trouble silences all.

    Args:
        settings: the configuration.
        clock: the service's.
        link: where the vehicle is.
        open_camera: makes a camera that is not opened yet.
        record: keeps what the sides see.

    Raises:
        ConfigError: a source that is not understood or does not exist.
    """

    def __init__(
        self,
        settings: Settings,
        clock: Clock,
        link: SideLink,
        open_camera: Callable[[ExtraCameraSettings], Camera] | None = None,
        record: Record | None = None,
    ) -> None:
        self._clock, self._link, self._record = clock, link, record
        self._merge = SideMerge(settings)
        self._stopping = threading.Event()
        self._sides: list[_Side] = []
        self._threads: list[threading.Thread] = []
        for extra in settings.extra_camera:
            if open_camera is not None:
                camera = open_camera(extra)
            else:
                camera = make_camera(extra.camera.source, extra.camera, clock, link, extra.mount.mount)
            frames: LatestSlot[Frame] = LatestSlot()
            own = side_settings(settings, extra)
            watch = SideWatch(extra.name, clock.now_ns(), link.say)
            self._sides.append(_Side(extra.name, own, CameraReader(camera, frames), frames, watch))

    def start(self, main: Perception) -> None:
        """Begin to read and measure, with the main camera's network.

        Raises:
            ConfigError: a mask that does not fit its camera.
        """
        for side in self._sides:
            side.perception = main.beside(side.settings)
        for side in self._sides:
            thread = threading.Thread(
                target=self._perceive, args=(side, side.perception), name=f"side {side.name}", daemon=True
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

    @property
    def failure(self) -> UavDepthError | None:
        """Why one of them can never work as configured, or None."""
        return next((side.reader.failure for side in self._sides if side.reader.failure), None)

    def added_to(self, result: PerceptionResult) -> PerceptionResult:
        """The main camera's result with what the sides see; itself where it is not trusted."""
        return self._merge.added_to(result)

    @property
    def sights(self) -> dict[str, Sight]:
        """Directions that each side sees, by its name."""
        return {
            side.name: Sight.of(side.settings.camera.model, side.settings.mount.mount) for side in self._sides
        }

    @property
    def losses(self) -> dict[str, SideLoss]:
        """What each side lacked when it was judged last, by its name."""
        return {side.name: side.watch.loss for side in self._sides}

    def sent(self, at_ns: int) -> None:
        """Note that the newest merged scan left at `at_ns`; to be called by the thread that merges."""
        for side in self._sides:
            captured_ns = self._merge.used_ns.get(side.name)
            if captured_ns is not None:
                side.watch.progress.sent(captured_ns, at_ns)

    def judge(self, now_ns: int, *, is_sending: bool) -> None:
        """Tell the pilot of sides that are lost or back; to be called several times a second.

        Args:
            now_ns: the moment.
            is_sending: distances are sent, with whatever sides there are.
        """
        for side in self._sides:
            left_out = self._merge.left_out.get(side.name)
            side.watch.judge(now_ns, side.reader.status, left_out, is_sending=is_sending)

    def status(self, now_ns: int) -> tuple[SideStatus, ...]:
        """Each side now."""
        return tuple(
            side.watch.status(
                now_ns,
                side.reader.status,
                0 if side.perception is None else side.perception.model_failures,
            )
            for side in self._sides
        )

    def _perceive(self, side: _Side, perception: Perception) -> None:
        while not self._stopping.is_set():
            frame = side.frames.take(_TAKE_S)
            if frame is None:
                continue
            try:
                begun_ns = self._clock.now_ns()
                result = perception.step_late(frame, self._link.telemetry_at)
                done_ns = self._clock.now_ns()
                self._merge.put(side.name, result)
                side.watch.progress.measured(result, begun_ns, done_ns)
                if self._record is not None:
                    self._record(result, begun_ns, done_ns, side.name)
                perception.look_ahead()
                remark = perception.remark(result)
                if remark is not None:
                    log.warning("of a side camera", camera=side.name, remark=remark)
                    self._link.say(SEVERITY_WARNING, f"{remark} ({side.name})")
            except Exception:
                self._merge.put(side.name, None)
                log.exception("a side camera's perception broke", camera=side.name, frame=frame.index)


def side_settings(settings: Settings, extra: ExtraCameraSettings) -> Settings:
    """The configuration of a further camera."""
    return settings.model_copy(update={"camera": extra.camera, "mount": extra.mount})
