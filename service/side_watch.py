"""Whether a further camera does its part, and what the pilot is told of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import structlog

from service.cameras.reader import CameraStatus
from service.health import SEVERITY_CRITICAL, SEVERITY_INFO, SEVERITY_WARNING, STALL_NS, Vitals, trouble_of
from service.progress import Progress
from service.status import SideStatus
from service.trouble import Trouble

log = structlog.get_logger()

_SETTLED_NS = 1_000_000_000
"""A side that lacks something, or is back, is told when it has been so for a second."""

_FAILED_NS = 300_000_000
"""One that has failed is told sooner: to ArduPilot its directions are free from now on (measured)."""


@dataclass(frozen=True)
class SideLoss:
    """What a further camera lacks.

    Args:
        trouble: why its distances are missing from what is sent; None if they are not.
        sent_ns: when they were sent last; None if never.
    """

    trouble: Trouble | None
    sent_ns: int | None


class SideWatch:
    """Judges one side by what it delivers, whether distances are sent now or not.

    A side that has failed is told at any time, on the ground too. One that lacks metres or a position, as all
    cameras do before take-off, is told only while the other cameras' distances are sent without it.

    Args:
        name: of the side.
        started_ns: when the service started.
        say: takes a severity and a text for the pilot.
    """

    def __init__(self, name: str, started_ns: int, say: Callable[[int, str], None]) -> None:
        self._name, self._started_ns, self._say = name, started_ns, say
        self.progress = Progress(started_ns)
        """What became of its pictures."""
        self._trouble: Trouble | None = None
        self._told: Trouble | None = None
        """What the pilot was told of; None if the side is well."""
        self._changed_ns: int | None = None
        self._losses = 0

    @property
    def loss(self) -> SideLoss:
        """As last judged."""
        return SideLoss(self._trouble, self.progress.sent_ns)

    def judge(self, now_ns: int, camera: CameraStatus, left_out: Trouble | None, *, is_sending: bool) -> None:
        """Find out what is wrong now, and tell the pilot of a side that is lost or back.

        Args:
            now_ns: the moment.
            camera: what the side's camera does.
            left_out: why the last merged scan is without it; None if it is in it or nothing is merged.
            is_sending: distances are sent.
        """
        trouble = self._find_trouble(now_ns, camera, left_out)
        # Without distances a lack is no news, nor is it any news of a side that was missing before.
        matters = is_sending or (self._told is not None and not self._told.is_fault)
        self._trouble = trouble if trouble is not None and (matters or trouble.is_fault) else None
        if (self._trouble is None) is (self._told is None):
            self._changed_ns = None
            return
        if self._changed_ns is None:
            self._changed_ns = now_ns
        has_failed = self._trouble is not None and self._trouble.is_fault
        if now_ns - self._changed_ns >= (_FAILED_NS if has_failed else _SETTLED_NS):
            self._told, self._changed_ns = self._trouble, None
            self._tell(camera, SEVERITY_CRITICAL if is_sending else SEVERITY_WARNING)

    def status(self, now_ns: int, camera: CameraStatus, model_failures: int) -> SideStatus:
        """The side now."""
        progress = self.progress
        result = progress.result
        return SideStatus(
            name=self._name,
            used=self._is_used(now_ns),
            trouble=self._trouble,
            camera=camera,
            frames_per_s=progress.frames_per_s(now_ns),
            age_s=None if result is None else max(0.0, (now_ns - result.captured_ns) / 1e9),
            latency=progress.latency,
            losses=self._losses,
            model_failures=model_failures,
        )

    def _is_used(self, now_ns: int) -> bool:
        sent_ns = self.progress.sent_ns
        return sent_ns is not None and now_ns - sent_ns <= STALL_NS

    def _find_trouble(self, now_ns: int, camera: CameraStatus, left_out: Trouble | None) -> Trouble | None:
        if self._is_used(now_ns):
            return None
        progress = self.progress
        result = progress.result
        vitals = Vitals(
            now_ns=now_ns,
            started_ns=self._started_ns,
            camera=camera.state,
            link_connected=True,
            armed=None,
            frame_ns=camera.newest_ns,
            result_ns=progress.result_ns,
            result_trouble=None if result is None else result.trouble,
            sent_ns=None,
        )
        trouble = trouble_of(vitals)
        if trouble is Trouble.NOT_SENT:  # all is well up to the merging
            trouble = left_out
        return trouble

    def _tell(self, camera: CameraStatus, severity: int) -> None:
        """Say what has changed; a loss with `severity`."""
        if self._trouble is None:
            log.info("side camera ON", camera=self._name)
            self._say(SEVERITY_INFO, f"uavdepth: camera {self._name} ON")
            return
        self._losses += 1
        result = self.progress.result
        because = camera.detail or ("" if result is None else result.detail)
        log.warning("side camera OFF", camera=self._name, trouble=self._trouble.value, because=because)
        self._say(severity, f"uavdepth: camera {self._name} OFF")
