"""A replay that speaks to a live autopilot or ground station."""

from __future__ import annotations

import threading
from dataclasses import replace
from types import TracebackType
from typing import Self

from service.autopilot.link import AutopilotLink
from service.autopilot.service_state import ServiceState
from service.clock import Clock, MonotonicClock
from service.perception_result import PerceptionResult
from service.publisher.publisher import ZenohPublisher
from service.settings import Settings


class LiveOutputs:
    """Results at the pace of the record, as if they were measured now.

    Args:
        settings: `[autopilot]` and `[zenoh]` say where to.
        autopilot: send scans to the configured endpoint.
        zenoh: publish for ground stations.
        clock: the live clock.
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

    def __enter__(self) -> Self:
        if self._link is not None:
            self._link.start()
            self._link.set_state(ServiceState.ACTIVE)
        if self._publisher is not None:
            self._publisher.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
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
            self._link.send_obstacles(now.scan, now.captured_ns)
        if self._publisher is not None:
            self._publisher.offer(now)
