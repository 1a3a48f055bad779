"""What a ground station says it has received: the vehicle fits its pictures to that."""

from __future__ import annotations

import secrets
from collections.abc import Callable
from typing import Final

from pydantic import Field

from service.publisher.wire import Count, Stamp, Words

REPORT_PERIOD_NS: Final = 200_000_000
"""A report comes with the first picture after so long: five a second at most, 2 kB/s at most."""


class ReceivedReport(Stamp):
    """Sample of `uavdepth/<vehicle>/received`; index and captured_ns are those of the newest picture.

    `age_ms` is how long that picture had been here when this was written, so that the vehicle can tell from
    its own clock alone how long the link took.

    Args:
        station: a name of the receiving session, made up anew each time.
        topic: where the newest picture came: "depth", "video" or "camera".
        interval_ms: what the counts are of.
        pictures, size_bytes: pictures that came in it and their bytes, attachments included.
        wants_key_frame: the video cannot be read before the next key frame.
    """

    station: Words
    topic: Words
    interval_ms: float = Field(ge=0.0, le=1e9)
    pictures: Count
    size_bytes: Count
    wants_key_frame: bool = False


class ReceivedReporter:
    """Counts the pictures of one vehicle and reports them.

    Args:
        send: takes the encoded report; puts it on `uavdepth/<vehicle>/received`.
    """

    def __init__(self, send: Callable[[bytes], None]) -> None:
        self._send = send
        self._station = secrets.token_hex(4)
        self._since_ns: int | None = None
        self._pictures = 0
        self._size_bytes = 0

    def hear(
        self, topic: str, header: Stamp, size_bytes: int, now_ns: int, *, wants_key_frame: bool = False
    ) -> None:
        """Count one picture, and report if it is time.

        Args:
            topic: where it came.
            header: what came with it.
            size_bytes: payload and attachment.
            now_ns: when it came, on the viewer's clock.
            wants_key_frame: the video cannot be read.
        """
        self._pictures += 1
        self._size_bytes += size_bytes
        since_ns = now_ns if self._since_ns is None else self._since_ns
        is_first = self._since_ns is None
        if not is_first and now_ns - since_ns < REPORT_PERIOD_NS:
            return
        report = ReceivedReport(
            index=header.index,
            captured_ns=header.captured_ns,
            age_ms=0.0,
            station=self._station,
            topic=topic,
            interval_ms=(now_ns - since_ns) / 1e6,
            pictures=self._pictures,
            size_bytes=self._size_bytes,
            wants_key_frame=wants_key_frame,
        )
        self._since_ns, self._pictures, self._size_bytes = now_ns, 0, 0
        self._send(report.encode())
