"""The Zenoh publisher: threads that nobody waits for."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass

import structlog
import zenoh

from service.clock import Clock
from service.pipeline import PerceptionResult
from service.publisher.line import RETRY_NS
from service.publisher.picture_thread import PictureThread
from service.publisher.scan_thread import ScanThread
from service.publisher.session import open_session
from service.publisher.status_wire import StatusSample
from service.publisher.video import require_video
from service.publisher.wire import Intrinsics
from service.settings.zenoh import ZenohSettings
from uavdepth.camera import CameraModel

log = structlog.get_logger()

_SILENT_S = 0.3
_CLOSE_S = 0.4
"""A session whose peer accepts and says nothing takes many seconds to close: its thread is left to that."""


@dataclass(frozen=True)
class PublisherStatus:
    """Zenoh at one moment.

    Args:
        open: a session is open.
        peers: peers and routers connected now.
        samples: published since the start, on all keys.
        detail: what is wrong, in words; empty if nothing.
        profile: what is sent: "full", "thin" or "scan-only".
        picture_bytes_per_s: what the pictures may take now.
        picture_delay_ms: from publishing to the ground's report of it; None where nobody reports.
    """

    open: bool
    peers: int
    samples: int
    detail: str
    profile: str = "full"
    picture_bytes_per_s: float = 0.0
    picture_delay_ms: float | None = None


class ZenohPublisher:
    """Publishes results and status of one vehicle.

    Scans and status have a thread and, towards the endpoints in `connect`, a session of their own. A port in
    use and peers that are away are told once and tried again for ever.

    Args:
        settings: `[zenoh]`.
        vehicle: second part of every key.
        camera: whose pixels the pictures have.
        clock: the service's.

    Raises:
        ConfigError: certificates, keys or passwords that cannot be used, or a profile that needs a package
            which is not installed.
    """

    def __init__(self, settings: ZenohSettings, vehicle: str, camera: CameraModel, clock: Clock) -> None:
        settings.security.check(settings.listen, settings.connect)
        if settings.profile == "thin":
            require_video()
        self._settings = settings
        self._pictures = PictureThread(settings, vehicle, Intrinsics.of(camera), clock, self._open)
        self._scans = ScanThread(settings, vehicle, clock, self._open, self._pictures.listening)
        self._reported = ""
        self._scans.on_turn = self._report

    @property
    def status(self) -> PublisherStatus:
        """Zenoh now."""
        scans, pictures = self._scans, self._pictures
        return PublisherStatus(
            open=scans.open,
            peers=scans.peers,
            samples=scans.samples + pictures.samples,
            detail=scans.problem or pictures.problem,
            profile=self._settings.profile,
            picture_bytes_per_s=pictures.budget.bytes_per_s,
            picture_delay_ms=pictures.budget.delay_ms,
        )

    @property
    def dropped_count(self) -> int:
        """Results that a newer one replaced before they were published."""
        return self._scans.results.dropped_count

    def start(self) -> None:
        """Begin to open the sessions; does not wait for them."""
        self._scans.start()
        self._pictures.start()

    def offer(self, result: PerceptionResult) -> None:
        """Make `result` the next to publish. Never waits."""
        self._scans.results.put(result)
        self._pictures.results.put(result)

    def offer_status(self, status: StatusSample) -> None:
        """Make `status` the next to publish. Never waits."""
        self._scans.statuses.put(status)

    def close(self) -> None:
        """Stop publishing and close the sessions; returns within a second, whoever does not answer."""
        # Pictures first: they also go through a session of the scans.
        self._pictures.stop(_SILENT_S)
        self._scans.stop()
        end_s = time.monotonic() + _CLOSE_S
        for thread in (self._pictures, self._scans):
            thread.join(max(0.0, end_s - time.monotonic()))

    def _open(self, listen: Sequence[str], connect: Sequence[str]) -> zenoh.Session:
        return open_session(listen, connect, self._settings.security)

    def _report(self) -> None:
        """Log a problem and its end once."""
        problem = self.status.detail
        if problem == self._reported:
            return
        if problem:
            log.warning("zenoh", problem=problem, tried_again_every_s=RETRY_NS / 1e9)
        else:
            log.info("zenoh works again")
        self._reported = problem
