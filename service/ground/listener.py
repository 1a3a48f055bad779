"""The ground station's Zenoh session: it feeds the fleet."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from types import TracebackType
from typing import Self

import zenoh

from service.ground.fleet import Fleet
from service.publisher import keys
from service.publisher.session import open_session


class FleetListener:
    """Subscribes to scans, status and liveliness of all vehicles, and to the pictures of those watched.

    Pictures that nobody looks at stay where they are: the vehicles do not even send them. A context
    manager. Peers that are away are reached when they come.

    Args:
        listen, connect: Zenoh endpoints.
        fleet: takes the samples.

    Raises:
        PublisherError: a session that cannot be opened.
    """

    def __init__(self, listen: Sequence[str], connect: Sequence[str], fleet: Fleet) -> None:
        self._fleet = fleet
        self._lock = threading.Lock()
        self._pictures: dict[str, list[zenoh.Subscriber[None]]] = {}
        self._session = open_session(listen, connect)
        for topic in (keys.SCAN, keys.STATUS):
            self._session.declare_subscriber(keys.key("*", topic), self._hear)
        self._session.liveliness().declare_subscriber(
            keys.key("*", keys.ALIVE), self._hear_alive, history=True
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        """Close the session."""
        self._session.close()  # type: ignore[no-untyped-call]

    def watch(self, vehicles: set[str]) -> None:
        """Receive the pictures of these vehicles and of no others."""
        with self._lock:
            for name in set(self._pictures) - vehicles:
                for subscriber in self._pictures.pop(name):
                    subscriber.undeclare()
            for name in vehicles - set(self._pictures):
                self._pictures[name] = [
                    self._session.declare_subscriber(keys.key(name, topic), self._hear)
                    for topic in (keys.CAMERA, keys.DEPTH)
                ]
        self._fleet.forget_pictures(vehicles)

    def peer_count(self) -> int:
        """Peers and routers that are connected now."""
        return len(self._session.info.peers_zid()) + len(self._session.info.routers_zid())

    def _hear(self, sample: zenoh.Sample) -> None:
        attachment = None if sample.attachment is None else sample.attachment.to_bytes()
        self._fleet.hear(str(sample.key_expr), sample.payload.to_bytes(), attachment)

    def _hear_alive(self, sample: zenoh.Sample) -> None:
        self._fleet.hear_alive(str(sample.key_expr), sample.kind == zenoh.SampleKind.PUT)
