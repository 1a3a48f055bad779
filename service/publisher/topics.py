"""The Zenoh publishers of one vehicle."""

from __future__ import annotations

import zenoh

from service.publisher import keys


class Topics:
    """The publishers of one vehicle, and its liveliness token, for as long as the session lives.

    Scans go before pictures, and nothing ever blocks: what a slow link cannot take is dropped.
    """

    def __init__(self, session: zenoh.Session, vehicle: str) -> None:
        self.scan = _declare(session, vehicle, keys.SCAN, zenoh.Encoding.APPLICATION_JSON, urgent=True)
        self.status = _declare(session, vehicle, keys.STATUS, zenoh.Encoding.APPLICATION_JSON, urgent=True)
        self.depth = _declare(session, vehicle, keys.DEPTH, zenoh.Encoding.IMAGE_PNG)
        self.camera = _declare(session, vehicle, keys.CAMERA, zenoh.Encoding.IMAGE_JPEG)
        self.alive = session.liveliness().declare_token(keys.key(vehicle, keys.ALIVE))


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
