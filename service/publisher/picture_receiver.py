"""The ground's end of the pictures of one vehicle: it reads every profile and reports what has arrived."""

from __future__ import annotations

import threading
from collections.abc import Callable

import zenoh

from service.clock import Clock
from service.errors import ConfigError
from service.publisher import keys
from service.publisher.received import ReceivedReporter
from service.publisher.video import VideoDecoder, VideoHeader
from service.publisher.wire import CameraHeader, DepthHeader, Stamp, WireError
from uavdepth.depth.codec import encode_codes_png
from uavdepth.errors import DepthCodecError

_HEADERS: dict[str, type[Stamp]] = {
    keys.DEPTH: DepthHeader,
    keys.CAMERA: CameraHeader,
    keys.VIDEO: VideoHeader,
}

Hear = Callable[[str, bytes, bytes | None], None]


class PictureReceiver:
    """Subscribes to the pictures of one vehicle for as long as somebody watches them.

    Video is decoded here and handed on as what `full` would have sent: a log-depth PNG with a `DepthHeader`
    on the key `uavdepth/<vehicle>/depth`; no browser has to know H.264. A sample whose header cannot be read
    is handed on as it came, so that it is counted where others are.

    Args:
        session: where the pictures come from; one that carries no scans, so that none waits for a picture.
        vehicle: its name.
        hear: takes key, payload and attachment; called from Zenoh's threads.
        clock: the viewer's.
        unreadable: told why a video picture cannot be read; the next key frame is asked for.
    """

    def __init__(
        self,
        session: zenoh.Session,
        vehicle: str,
        hear: Hear,
        clock: Clock,
        unreadable: Callable[[str], None] = lambda _why: None,
    ) -> None:
        self._session = session
        self._vehicle = vehicle
        self._hear = hear
        self._clock = clock
        self._unreadable = unreadable
        self._decoder = VideoDecoder()
        self._lock = threading.Lock()
        report_key = keys.key(vehicle, keys.RECEIVED)
        self._reporter = ReceivedReporter(lambda report: session.put(report_key, report))
        self._subscribers = [
            session.declare_subscriber(keys.key(vehicle, topic), self._receive) for topic in _HEADERS
        ]

    def close(self) -> None:
        """Watch no more: the vehicle stops sending what nobody watches."""
        for subscriber in self._subscribers:
            subscriber.undeclare()  # type: ignore[no-untyped-call]

    def _receive(self, sample: zenoh.Sample) -> None:
        attachment = None if sample.attachment is None else sample.attachment.to_bytes()
        self.receive(str(sample.key_expr), sample.payload.to_bytes(), attachment)

    def receive(self, key: str, payload: bytes, attachment: bytes | None) -> None:
        """Take one sample, which need not be what its key says."""
        # Samples of two peers under one name come in two threads, and FFmpeg's decoder is for one.
        with self._lock:
            self._take(key, payload, attachment)

    def _take(self, key: str, payload: bytes, attachment: bytes | None) -> None:
        topic = key.rpartition("/")[2]
        try:
            header = _HEADERS[topic].decode(attachment or b"")
        except (KeyError, WireError):
            self._hear(key, payload, attachment)
            return
        size_bytes = len(payload) + len(attachment or b"")
        if isinstance(header, VideoHeader):
            self._receive_video(header, payload, size_bytes)
            return
        self._reporter.hear(topic, header, size_bytes, self._clock.now_ns())
        self._hear(key, payload, attachment)

    def _receive_video(self, header: VideoHeader, payload: bytes, size_bytes: int) -> None:
        codes = None
        try:
            codes = self._decoder.decode(header, payload)
        except (DepthCodecError, ConfigError) as error:
            self._unreadable(str(error))
        wants_key_frame = self._decoder.wants_key_frame
        now_ns = self._clock.now_ns()
        self._reporter.hear(keys.VIDEO, header, size_bytes, now_ns, wants_key_frame=wants_key_frame)
        if codes is not None:
            same = header.model_dump(include={"index", "captured_ns", "age_ms", "near_m", "far_m"})
            depth = DepthHeader(**same, camera=header.camera)
            self._hear(keys.key(self._vehicle, keys.DEPTH), encode_codes_png(codes), depth.encode())
