"""A replay that speaks to a live autopilot or ground station."""

from __future__ import annotations

import math
import threading
from dataclasses import replace
from types import TracebackType
from typing import Self

from service.autopilot.link import AutopilotLink
from service.autopilot.service_state import ServiceState
from service.clock import Clock, MonotonicClock
from service.errors import RecordError
from service.perception_result import PerceptionResult
from service.publisher.publisher import ZenohPublisher
from service.publisher.status_wire import StatusSample
from service.settings import Settings
from service.status import resident_memory_mib

_AUTOPILOT_NS = 5_000_000_000
_STATUS_NS = 500_000_000
_POLL_S = 0.02


class LiveOutputs:
    """Results at the pace of the record, as if they were measured now.

    Args:
        settings: `[autopilot]` and `[zenoh]` say where to.
        autopilot: send scans to the configured endpoint.
        zenoh: publish for ground stations.
        clock: the live clock.

    Raises:
        LinkError: an endpoint that cannot be opened.
        RecordError: no autopilot is heard within 5 s.
    """

    def __init__(
        self, settings: Settings, *, autopilot: bool, zenoh: bool, clock: Clock | None = None
    ) -> None:
        self._clock = MonotonicClock() if clock is None else clock
        self._link = AutopilotLink(settings.autopilot, self._clock) if autopilot else None
        self._publisher: ZenohPublisher | None = None
        if zenoh:
            self._publisher = ZenohPublisher(
                settings.zenoh, settings.vehicle.name, settings.camera.model, self._clock
            )
        self._shift_ns: int | None = None
        self._pause = threading.Event()
        self._vehicle = settings.vehicle.name
        self._started_ns = self._status_due_ns = self._clock.now_ns()
        self._sent = 0

    def __enter__(self) -> Self:
        if self._publisher is not None:
            self._publisher.start()
        if self._link is not None:
            self._link.start()
            self._link.set_state(ServiceState.ACTIVE)
            try:
                self._wait_for_autopilot(self._link)
            except RecordError:
                self._close()
                raise
        return self

    def _wait_for_autopilot(self, link: AutopilotLink) -> None:
        end_ns = self._clock.now_ns() + _AUTOPILOT_NS
        while not link.status().connected:
            if self._clock.now_ns() > end_ns:
                status = link.status()
                raise RecordError(
                    f"replay: no autopilot heard at {status.endpoint} within {_AUTOPILOT_NS / 1e9:.0f} s"
                    + (f" ({status.problem})" if status.problem else "")
                )
            self._pause.wait(_POLL_S)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._close()

    def _close(self) -> None:
        if self._publisher is not None:
            self._publisher.close()
        if self._link is not None:
            self._link.close()

    def show(self, result: PerceptionResult, done_ns: int) -> None:
        """Wait until `done_ns` of the record has come, then tell the result."""
        if self._shift_ns is None:
            self._shift_ns = self._clock.now_ns() - done_ns
        wait_s = (done_ns + self._shift_ns - self._clock.now_ns()) / 1e9
        if wait_s > 0:
            self._pause.wait(wait_s)
        now = replace(result, frame=replace(result.frame, captured_ns=result.captured_ns + self._shift_ns))
        if self._link is not None and result.trusted:
            self._sent += self._link.send_obstacles(now.scan, now.captured_ns)
        if self._publisher is not None:
            self._publisher.offer(now)
            if self._clock.now_ns() >= self._status_due_ns:
                self._status_due_ns = self._clock.now_ns() + _STATUS_NS
                self._publisher.offer_status(self._status(result))

    def _status(self, result: PerceptionResult) -> StatusSample:
        """What a ground station shows besides the pictures."""
        telemetry, scale = result.telemetry, result.scale
        north, east, _ = telemetry.velocity_ned_mps or (None, None, None)
        return StatusSample(
            vehicle=self._vehicle,
            state=(ServiceState.ACTIVE if result.trusted else ServiceState.STANDBY).name,
            trouble=None if result.trouble is None else result.trouble.value,
            uptime_s=(self._clock.now_ns() - self._started_ns) / 1e9,
            frames_per_s=0.0,
            obstacle_messages=self._sent,
            scale_factor=None if scale is None else scale.factor,
            scale_relative_sigma=None if scale is None else scale.relative_sigma,
            scale_age_s=None if scale is None else scale.age_s,
            height_m=telemetry.height_m,
            mode=telemetry.mode,
            armed=telemetry.armed,
            altitude_m=None if telemetry.position_ned_m is None else -telemetry.position_ned_m[2],
            speed_mps=None if north is None or east is None else math.hypot(north, east),
            camera="replay",
            camera_detail="a record is played",
            link_connected=self._link is not None and self._link.status().connected,
            memory_mib=resident_memory_mib(),
        )
