"""The Zenoh publishers of one vehicle."""

from __future__ import annotations

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
    """Depth, video and camera pictures, for as long as the session lives."""

    def __init__(self, session: zenoh.Session, vehicle: str) -> None:
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
