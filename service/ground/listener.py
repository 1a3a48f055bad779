"""The ground station's Zenoh sessions: they feed the fleet."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from contextlib import ExitStack
from typing import Self

import zenoh

from service.clock import Clock
from service.ground.fleet import Fleet
from service.publisher.picture_receiver import PictureReceiver
from service.publisher.session import station_session
from service.publisher.vehicle_samples import hear_vehicles
from service.security.security import Security


class FleetListener:
    """Subscribes to scans, status and liveliness of all vehicles, and to the pictures of those watched.

    Pictures that nobody looks at stay where they are: the vehicles do not even send them. Pictures come
    over a session of their own, so that no scan waits for one; vehicles that connect to `listen` open one
    of their own for them. A context manager. Peers that are away are reached when they come.

    Args:
        listen, connect: Zenoh endpoints.
        fleet: takes the samples.
        clock: the viewer's.
        security: certificates and passwords; None: none of them.

    Raises:
        SecurityError: certificates, keys or passwords that cannot be used.
        PublisherError: a session that cannot be opened.
    """

    def __init__(
        self,
        listen: Sequence[str],
        connect: Sequence[str],
        fleet: Fleet,
        clock: Clock,
        security: Security | None = None,
    ) -> None:
        self._fleet = fleet
        self._clock = clock
        self._lock = threading.Lock()
        self._receivers: dict[str, list[PictureReceiver]] = {}
        with ExitStack() as stack:
            self._session = stack.enter_context(station_session(listen, connect, security))
            self._picture_sessions: list[zenoh.Session] = [self._session] if listen else []
            if connect:
                own = stack.enter_context(station_session([], connect, security))
                self._picture_sessions.append(own)
            self._sessions = stack.pop_all()
        hear_vehicles(
            self._session,
            lambda key, payload: fleet.hear(key, payload, None),
            fleet.hear_alive,
            fleet.bad_samples,
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the sessions."""
        self._sessions.close()

    def watch(self, vehicles: set[str]) -> None:
        """Receive the pictures of these vehicles and of no others."""
        with self._lock:
            for name in set(self._receivers) - vehicles:
                for receiver in self._receivers.pop(name):
                    receiver.close()
            for name in vehicles - set(self._receivers):
                self._receivers[name] = [self._receive(session, name) for session in self._picture_sessions]
        self._fleet.forget_pictures(vehicles)

    def peer_count(self) -> int:
        """Vehicles and routers that are connected now."""
        return len(self._session.info.peers_zid()) + len(self._session.info.routers_zid())

    def _receive(self, session: zenoh.Session, vehicle: str) -> PictureReceiver:
        return PictureReceiver(
            session,
            vehicle,
            self._fleet.hear,
            self._clock,
            lambda why: self._fleet.bad_samples.note(f"video of {vehicle}: {why}"),
        )
