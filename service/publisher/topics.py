"""The Zenoh publishers of one vehicle."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from typing import Any

import zenoh

from service.publisher import keys

_JSON = zenoh.Encoding.APPLICATION_JSON


class ScanTopics:
    """Scans, status and the liveliness token, for as long as the session lives.

    They go before everything else, and nothing ever blocks: what a slow link cannot take is dropped.
    """

    def __init__(self, session: zenoh.Session, vehicle: str) -> None:
        self.scan = _declare(session, vehicle, keys.SCAN, _JSON, urgent=True)
        self.status = _declare(session, vehicle, keys.STATUS, _JSON, urgent=True)
        self.alive = session.liveliness().declare_token(keys.key(vehicle, keys.ALIVE))


class PictureTopics:
    """Depth, video and camera pictures, for as long as the session lives or until `close`.

    Args:
        session: where they go.
        vehicle: its name.
        report: takes what ground stations say has arrived; called from Zenoh's threads. None: nobody does.
    """

    def __init__(
        self, session: zenoh.Session, vehicle: str, report: Callable[[zenoh.Sample], None] | None = None
    ) -> None:
        self._reports: zenoh.Subscriber[None] | None = None
        if report is not None:
            self._reports = session.declare_subscriber(keys.key(vehicle, keys.RECEIVED), report)
        self._publishers = {
            keys.DEPTH: _declare(session, vehicle, keys.DEPTH, zenoh.Encoding.IMAGE_PNG),
            keys.VIDEO: _declare(session, vehicle, keys.VIDEO, zenoh.Encoding.VIDEO_H264),
            keys.CAMERA: _declare(session, vehicle, keys.CAMERA, zenoh.Encoding.IMAGE_JPEG),
        }

    def watched(self, topic: str) -> bool:
        """Whether anybody has subscribed to it."""
        # Typed as bool, but an object whose truth is always True (eclipse-zenoh 1.10).
        status: Any = self._publishers[topic].matching_status
        return bool(status.matching)

    def put(self, topic: str, payload: bytes, attachment: bytes) -> None:
        """Send one picture."""
        self._publishers[topic].put(payload, attachment=attachment)

    def close(self) -> None:
        """Take back what was declared: the session may go on. Never raises."""
        for publisher in self._publishers.values():
            with suppress(zenoh.ZError):
                publisher.undeclare()  # type: ignore[no-untyped-call]
        if self._reports is not None:
            with suppress(zenoh.ZError):
                self._reports.undeclare()  # type: ignore[no-untyped-call]


def _declare(
    session: zenoh.Session, vehicle: str, topic: str, encoding: zenoh.Encoding, *, urgent: bool = False
) -> zenoh.Publisher:
    return session.declare_publisher(
        keys.key(vehicle, topic),
        encoding=encoding,
        congestion_control=zenoh.CongestionControl.DROP,
        priority=zenoh.Priority.REAL_TIME if urgent else zenoh.Priority.DATA_LOW,
        express=urgent,
    )
