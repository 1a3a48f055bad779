"""The latency that a running service measures, heard over Zenoh while the doctor listens to the autopilot."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

from service.clock import Clock
from service.publisher.status_wire import StatusSample
from service.security.security import Security
from service.settings.zenoh import ZenohSettings
from service.watch.board import Board, VehicleView
from service.watch.listener import Listener
from uavdepth.errors import UavDepthError

_WAIT_NS = 2_000_000_000
"""A status comes twice a second by default; the session needs half a second to open."""

_LOOK_S = 0.05
_EVERYWHERE = {"0.0.0.0": "127.0.0.1", "[::]": "[::1]"}


@dataclass(frozen=True)
class KnownLatency:
    """A latency from capture to wire and where it comes from.

    Args:
        seconds: 19 of 20 messages were not slower; None if it is not known.
        source: who tells it, or why nobody does, in words.
    """

    seconds: float | None
    source: str


class ServiceEar:
    """Hears the status of running services for as long as it is entered; never raises, never waits long.

    Args:
        connect: endpoints of services and routers; none: nothing is opened.
        security: certificates and passwords; None: none of them.
        vehicle: name of the vehicle that is meant; None: whichever is alone.
        clock: the live clock.
    """

    def __init__(
        self, connect: Sequence[str], security: Security | None, vehicle: str | None, clock: Clock
    ) -> None:
        self._connect, self._security = tuple(connect), security
        self._vehicle, self._clock = vehicle, clock
        self._board = Board()
        self._listener: Listener | None = None
        self._problem = "" if self._connect else "[zenoh] enabled is false, and no --connect is given"
        self._opened_ns = clock.now_ns()

    def __enter__(self) -> Self:
        if self._connect:
            try:
                self._listener = Listener(self._connect, self._board, self._clock, (), self._security)
            except UavDepthError as error:
                self._problem = str(error)
        return self

    def __exit__(self, *_: object) -> None:
        if self._listener is not None:
            self._listener.close()

    def latency(self, system_id: int | None, stop: threading.Event) -> KnownLatency:
        """The newest, for which it waits until 2 s after it was entered.

        Args:
            system_id: of the autopilot that is examined; None if none was heard.
            stop: ends the waiting.
        """
        if self._listener is None:
            return KnownLatency(None, self._problem)
        places = ", ".join(self._connect)
        while True:
            now_ns = self._clock.now_ns()
            known = latency_of(self._board.vehicles(now_ns), self._vehicle, system_id, places)
            if known.seconds is not None or now_ns - self._opened_ns > _WAIT_NS or stop.wait(_LOOK_S):
                return known


def latency_of(
    views: Sequence[VehicleView], vehicle: str | None, system_id: int | None, places: str
) -> KnownLatency:
    """The latency of the one service that speaks with the examined autopilot.

    Args:
        views: the services that are heard now.
        vehicle: name of the one that is meant; None: whichever is alone.
        system_id: of the autopilot that is examined; None if none was heard.
        places: where services were looked for, for the words.
    """
    told = {
        view.name: view.status for view in views if view.status is not None and vehicle in (None, view.name)
    }
    if not told:
        return KnownLatency(None, f"no running service{f' of {vehicle}' if vehicle else ''} at {places}")
    fitting = {
        name: status
        for name, status in told.items()
        if system_id is None or status.system_id in (None, system_id)
    }
    if not fitting:
        words = f"the service of {', '.join(told)} speaks with another autopilot than system {system_id}"
        return KnownLatency(None, words)
    if len(fitting) > 1:
        words = f"services of {', '.join(fitting)} run: say in [vehicle] name which one is meant"
        return KnownLatency(None, words)
    ((name, status),) = fitting.items()
    slowest_ms = slowest_latency_ms(status)
    if slowest_ms is None:
        return KnownLatency(None, f"the service of {name} has not sent distances yet")
    return KnownLatency(slowest_ms / 1000.0, f"measured by the running service of {name}")


def slowest_latency_ms(status: StatusSample) -> float | None:
    """What 19 of 20 messages keep, of the camera that is slowest; None before the first message."""
    known = (status.latency_ms_p95, *(extra.latency_ms_p95 for extra in status.extra_cameras))
    return max((ms for ms in known if ms is not None), default=None)


def service_endpoints(zenoh: ZenohSettings) -> tuple[str, ...]:
    """Where a service is heard by a configuration: where it listens, on this computer, and where it connects.

    A viewer's file with certificates names no place to listen, and the default one is without TLS.
    """
    if not zenoh.enabled:
        return ()
    listens = "listen" in zenoh.model_fields_set or not zenoh.ca
    return (*(_reachable(endpoint) for endpoint in zenoh.listen if listens), *zenoh.connect)


def _reachable(endpoint: str) -> str:
    kind, _, place = endpoint.partition("/")
    host, colon, rest = place.rpartition(":")
    return f"{kind}/{_EVERYWHERE.get(host, host)}{colon}{rest}"
