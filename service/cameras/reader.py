"""The background reader: keeps the newest picture and brings a lost camera back."""

from __future__ import annotations

import threading
from dataclasses import dataclass, replace
from enum import Enum

import structlog

from service.cameras.camera import Camera, CameraEndedError, CameraTimeoutError, PictureSizeError
from service.cameras.freeze_watch import FreezeWatch
from service.errors import CameraError, ConfigError
from service.frame import Frame
from service.latest_slot import LatestSlot
from service.thread_rank import stand_back
from uavdepth.errors import SceneError, UavDepthError

log = structlog.get_logger()

_JOIN_TIMEOUT_S = 2.0
"""A driver that blocks in its own read is left behind after it: the thread is a daemon."""


class CameraState(Enum):
    """What the camera does."""

    OPENING = "opening"
    DELIVERING = "delivering"
    WAITING = "waiting"
    """Open, but no picture comes."""
    LOST = "lost"
    """Closed after a failure; tried again."""
    ENDED = "ended"
    """A file is over."""
    FAILED = "failed"
    """It can never work as configured; not tried again."""


@dataclass(frozen=True)
class CameraStatus:
    """The camera at one moment.

    Args:
        state: what it does.
        detail: what went wrong last, in words; empty while it delivers.
        frames: pictures delivered since the start.
        reopened: how often it was opened again.
        newest_ns: when the newest picture arrived, None before the first.
    """

    state: CameraState
    detail: str
    frames: int
    reopened: int
    newest_ns: int | None = None


class CameraReader:
    """Reads a camera in a thread of its own and puts each picture into a slot.

    Args:
        camera: the camera, not opened yet.
        slot: where the pictures go.
    """

    def __init__(self, camera: Camera, slot: LatestSlot[Frame]) -> None:
        self._camera = camera
        self._slot = slot
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name="camera", daemon=True)
        self._status = CameraStatus(CameraState.OPENING, "", 0, 0)
        self._reported = ""
        self._freeze = FreezeWatch()
        self._failure: UavDepthError | None = None

    @property
    def status(self) -> CameraStatus:
        """The camera now."""
        return self._status

    @property
    def camera_name(self) -> str:
        """The camera, for messages."""
        return self._camera.name

    @property
    def failure(self) -> UavDepthError | None:
        """Why the camera can never work as configured, or None."""
        return self._failure

    def start(self) -> None:
        """Begin to open and read."""
        self._thread.start()

    def stop(self) -> None:
        """Stop reading and close the camera."""
        self._stopping.set()
        self._camera.interrupt()
        if self._thread.is_alive():
            self._thread.join(_JOIN_TIMEOUT_S)

    def _run(self) -> None:
        if self._camera.stands_back:
            stand_back()
        pause_s = self._camera.settings.reopen_after_s
        while not self._stopping.is_set():
            frames_before = self._status.frames
            try:
                self._open_and_deliver()
                return
            except CameraEndedError as error:
                log.info("camera ended", camera=self._camera.name)
                self._show(CameraState.ENDED, str(error))
                return
            except (ConfigError, SceneError) as error:
                self._give_up(error)
                return
            except PictureSizeError as error:
                if self._status.frames == 0:
                    self._give_up(ConfigError(str(error)))
                    return
                self._lose(str(error))
            except CameraError as error:
                self._lose(str(error))
            except Exception as error:
                # A driver's surprise must not end the flight's pictures for good.
                log.exception("camera broke", camera=self._camera.name)
                self._lose(f"camera {self._camera.name}: {type(error).__name__}: {error}")
            finally:
                self._camera.close()
            if self._status.frames > frames_before:
                pause_s = self._camera.settings.reopen_after_s
            self._stopping.wait(pause_s)
            pause_s = min(2 * pause_s, self._camera.settings.reopen_at_most_s)
            self._count_reopening()

    def _open_and_deliver(self) -> None:
        self._camera.open()
        if self._camera.granted:
            log.info("camera open", camera=self._camera.name, delivers=self._camera.granted)
        while not self._stopping.is_set():
            try:
                frame = self._camera.read(self._camera.settings.read_timeout_s)
            except CameraTimeoutError as error:
                if self._stopping.is_set():
                    return
                if self._camera.reopen_on_timeout:
                    raise
                self._report(str(error), "camera waits")
                self._show(CameraState.WAITING, str(error))
                continue
            if self._camera.has_noise and self._freeze.repeats(frame.image_bgr):
                words = f"camera {self._camera.name}: delivers the same picture again and again"
                self._report(words, "camera hangs")
                self._show(CameraState.WAITING, words)
                continue
            self._slot.put(frame)
            if self._reported:
                log.info("camera delivers again", camera=self._camera.name)
                self._reported = ""
            self._status = replace(
                self._status,
                state=CameraState.DELIVERING,
                detail="",
                frames=self._status.frames + 1,
                newest_ns=self._camera.clock.now_ns(),
            )

    def _give_up(self, error: UavDepthError) -> None:
        self._failure = error
        self._show(CameraState.FAILED, str(error))

    def _lose(self, detail: str) -> None:
        self._report(detail)
        self._show(CameraState.LOST, detail)

    def _report(self, detail: str, what: str = "camera lost, tried again until it delivers") -> None:
        """Log a failure once, not at each of its repetitions."""
        if detail != self._reported and not self._stopping.is_set():
            log.warning(what, reason=detail)
        self._reported = detail

    def _show(self, state: CameraState, detail: str) -> None:
        self._status = replace(self._status, state=state, detail=detail)

    def _count_reopening(self) -> None:
        self._status = replace(self._status, reopened=self._status.reopened + 1)
