"""The Zenoh publisher: a thread that nobody waits for."""

from __future__ import annotations

import threading
from dataclasses import dataclass

import cv2
import structlog
import zenoh

from service.clock import Clock
from service.errors import PublisherError
from service.latest_slot import LatestSlot
from service.pipeline import PerceptionResult
from service.publisher.rate_limit import RateLimit
from service.publisher.session import open_session
from service.publisher.topics import Topics
from service.publisher.wire import CameraHeader, DepthHeader, Intrinsics, ScanSample, Stamp, StatusSample
from service.settings.zenoh import ZenohSettings
from uavdepth.camera import CameraModel
from uavdepth.depth_codec import encode_depth_png

log = structlog.get_logger()

_RETRY_S = 2.0
_TAKE_S = 0.1
_PEERS_PERIOD_NS = 1_000_000_000
_JOIN_TIMEOUT_S = 2.0


@dataclass(frozen=True)
class PublisherStatus:
    """Zenoh at one moment.

    Args:
        open: the session is open.
        peers: peers and routers connected now.
        samples: published since the start, on all keys.
        detail: what is wrong, in words; empty if nothing.
    """

    open: bool
    peers: int
    samples: int
    detail: str


class ZenohPublisher:
    """Publishes results and status of one vehicle.

    A port in use and peers that are away are told once and tried again for ever.

    Args:
        settings: `[zenoh]`.
        vehicle: second part of every key.
        camera: whose pixels the pictures have.
        clock: the service's.
    """

    def __init__(self, settings: ZenohSettings, vehicle: str, camera: CameraModel, clock: Clock) -> None:
        self._settings = settings
        self._vehicle = vehicle
        self._intrinsics = Intrinsics.of(camera)
        self._clock = clock
        self._results: LatestSlot[PerceptionResult] = LatestSlot()
        self._statuses: LatestSlot[StatusSample] = LatestSlot()
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name="zenoh", daemon=True)
        self._status = PublisherStatus(open=False, peers=0, samples=0, detail="")
        self._samples = 0
        self._reported = ""

    @property
    def status(self) -> PublisherStatus:
        """Zenoh now."""
        return self._status

    @property
    def dropped_count(self) -> int:
        """Results that a newer one replaced before they were published."""
        return self._results.dropped_count

    def start(self) -> None:
        """Begin to open the session; does not wait for it."""
        self._thread.start()

    def offer(self, result: PerceptionResult) -> None:
        """Make `result` the next to publish. Never waits."""
        self._results.put(result)

    def offer_status(self, status: StatusSample) -> None:
        """Make `status` the next to publish. Never waits."""
        self._statuses.put(status)

    def close(self) -> None:
        """Stop publishing and close the session."""
        self._stopping.set()
        self._results.close()
        self._statuses.close()
        if self._thread.is_alive():
            self._thread.join(_JOIN_TIMEOUT_S)

    def _run(self) -> None:
        while not self._stopping.is_set():
            try:
                with open_session(self._settings.listen, self._settings.connect) as session:
                    self._report("")
                    self._publish(session)
            except (PublisherError, zenoh.ZError) as error:
                self._report(str(error))
            except Exception as error:
                # Whatever breaks here, the vehicle's obstacles go on; the session is opened anew.
                log.exception("zenoh publisher broke")
                self._report(f"zenoh: {type(error).__name__}: {error}")
            self._stopping.wait(_RETRY_S)

    def _publish(self, session: zenoh.Session) -> None:
        topics = Topics(session, self._vehicle)
        scan_limit = RateLimit(self._settings.scan_rate_hz)
        depth_limit = RateLimit(self._settings.depth_rate_hz)
        camera_limit = RateLimit(self._settings.camera_rate_hz)
        peers_due_ns = self._clock.now_ns()
        while not self._stopping.is_set():
            result = self._results.take(_TAKE_S)
            now_ns = self._clock.now_ns()
            if result is not None:
                age_ms = max(0.0, (now_ns - result.captured_ns) / 1e6)
                if scan_limit.allows(now_ns):
                    self._put(topics.scan, self._scan_sample(result, age_ms).encode())
                if result.depth is not None and depth_limit.allows(now_ns):
                    self._put_depth(topics.depth, result, age_ms)
                if self._settings.camera and camera_limit.allows(now_ns):
                    self._put_camera(topics.camera, result, age_ms)
            status = self._statuses.take()
            if status is not None:
                self._put(topics.status, status.encode())
            if now_ns >= peers_due_ns:
                peers_due_ns = now_ns + _PEERS_PERIOD_NS
                self._count_peers(session)

    def _scan_sample(self, result: PerceptionResult, age_ms: float) -> ScanSample:
        trouble = None if result.trouble is None else result.trouble.value
        return ScanSample.of(
            result.scan,
            index=result.frame.index,
            captured_ns=result.captured_ns,
            age_ms=age_ms,
            trouble=trouble,
        )

    def _put_depth(self, publisher: zenoh.Publisher, result: PerceptionResult, age_ms: float) -> None:
        if result.depth is None:
            return
        near_m, far_m = self._settings.depth_near_m, self._settings.depth_far_m
        header = DepthHeader(
            index=result.frame.index,
            captured_ns=result.captured_ns,
            age_ms=age_ms,
            near_m=near_m,
            far_m=far_m,
            camera=self._intrinsics,
            scale_factor=None if result.scale is None else result.scale.factor,
            scale_relative_sigma=None if result.scale is None else result.scale.relative_sigma,
        )
        self._put(publisher, encode_depth_png(result.depth.depth_m, near_m, far_m), header)

    def _put_camera(self, publisher: zenoh.Publisher, result: PerceptionResult, age_ms: float) -> None:
        quality = [cv2.IMWRITE_JPEG_QUALITY, self._settings.camera_quality]
        written, data = cv2.imencode(".jpg", result.frame.image_bgr, quality)
        if written:
            header = CameraHeader(
                index=result.frame.index,
                captured_ns=result.captured_ns,
                age_ms=age_ms,
                camera=self._intrinsics,
            )
            self._put(publisher, data.tobytes(), header)

    def _put(self, publisher: zenoh.Publisher, payload: bytes, header: Stamp | None = None) -> None:
        publisher.put(payload, attachment=None if header is None else header.encode())
        self._samples += 1

    def _count_peers(self, session: zenoh.Session) -> None:
        peers = len(session.info.peers_zid()) + len(session.info.routers_zid())
        detail = ""
        if self._settings.connect and peers == 0:
            detail = f"no peer at {', '.join(self._settings.connect)}; tried again"
        self._report(detail, peers, is_open=True)

    def _report(self, detail: str, peers: int = 0, *, is_open: bool = False) -> None:
        """Log a problem and its end once."""
        self._status = PublisherStatus(is_open or not detail, peers, self._samples, detail)
        if detail == self._reported:
            return
        if detail:
            log.warning("zenoh", problem=detail, tried_again_every_s=_RETRY_S)
        else:
            log.info("zenoh works again")
        self._reported = detail
