"""Scans and pictures over a slow radio: what arrives, and how late."""

from __future__ import annotations

import threading
from contextlib import ExitStack
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
import zenoh

from service.benchmark.stream_link import LinkSettings, SlowLink
from service.benchmark.stream_vehicle import StreamVehicle
from service.clock import MonotonicClock
from service.demo.plan import free_zenoh_endpoint
from service.errors import PublisherError
from service.publisher import keys
from service.publisher.picture_receiver import PictureReceiver
from service.publisher.session import Role, open_session
from service.publisher.wire import CameraHeader, DepthHeader, ScanSample, Stamp
from service.settings.zenoh import ZenohSettings

VEHICLE = "benchmark"


@dataclass(frozen=True)
class TopicFigures:
    """What arrived of one topic.

    Args:
        per_s: samples a second.
        kbit_per_s: payloads and attachments.
        latency_ms_p50, latency_ms_p95, latency_ms_max: from capture to the ground program.
        width: of the newest picture in pixels; None for scans.
    """

    per_s: float
    kbit_per_s: float
    latency_ms_p50: float | None
    latency_ms_p95: float | None
    latency_ms_max: float | None
    width: int | None = None


@dataclass(frozen=True)
class StreamFigures:
    """One run.

    Args:
        profile: what the vehicle sends.
        link_kbit_per_s: rate of the radio.
        offered_kbit_per_s: what depth, camera and scans would take unhindered.
        carried_kbit_per_s: what went through the radio towards the ground.
        longest_queue_ms: longest wait in the radio.
        settling: the same for the first seconds, which are in no other figure.
        topics: what arrived afterwards.
    """

    profile: str
    link_kbit_per_s: float
    offered_kbit_per_s: float
    carried_kbit_per_s: float
    longest_queue_ms: float
    settling: dict[str, TopicFigures]
    topics: dict[str, TopicFigures]

    def as_json(self) -> dict[str, Any]:
        """Plain values."""
        return asdict(self)


@dataclass
class _Heard:
    latencies_ms: list[float] = field(default_factory=list)
    size_bytes: int = 0
    width: int | None = None

    def figures(self, seconds: float) -> TopicFigures:
        late = self.latencies_ms
        p50, p95, most = (
            (round(float(np.percentile(late, share)), 1) for share in (50, 95, 100)) if late else (None,) * 3
        )
        return TopicFigures(
            round(len(late) / seconds, 1),
            round(8e-3 * self.size_bytes / seconds, 1),
            p50,
            p95,
            most,
            self.width,
        )


class _Station:
    """Counts what arrives, by topic."""

    def __init__(self, clock: MonotonicClock) -> None:
        self._clock = clock
        self._lock = threading.Lock()
        self._heard: dict[str, _Heard] = {}

    def hear(self, key: str, payload: bytes, attachment: bytes | None) -> None:
        now_ns = self._clock.now_ns()
        topic = key.rpartition("/")[2]
        kinds: dict[str, type[Stamp]] = {keys.DEPTH: DepthHeader, keys.CAMERA: CameraHeader}
        stamp = ScanSample.decode(payload) if topic == keys.SCAN else kinds[topic].decode(attachment or b"")
        with self._lock:
            heard = self._heard.setdefault(topic, _Heard())
            heard.latencies_ms.append((now_ns - stamp.captured_ns) / 1e6)
            heard.size_bytes += len(payload) + len(attachment or b"")
            if isinstance(stamp, DepthHeader | CameraHeader):
                heard.width = stamp.camera.width

    def take(self, sample: zenoh.Sample) -> None:
        attachment = None if sample.attachment is None else sample.attachment.to_bytes()
        self.hear(str(sample.key_expr), sample.payload.to_bytes(), attachment)

    def heard(self) -> dict[str, _Heard]:
        with self._lock:
            heard, self._heard = self._heard, {}
            return heard


def measure_stream(
    link: LinkSettings,
    seconds: float,
    settling_s: float,
    overrides: dict[str, Any],
    *,
    one_session: bool = False,
) -> StreamFigures:
    """Send a vehicle's stream over a slow radio and measure what arrives.

    Args:
        link: the radio.
        seconds: how long it is measured.
        settling_s: how long it runs before.
        overrides: keys of `[zenoh]`.
        one_session: the ground uses one session for all and reports nothing, as a foreign viewer does.

    Raises:
        PublisherError: the vehicle does not start, or nothing arrives.
    """
    endpoint = free_zenoh_endpoint()
    settings = ZenohSettings(listen=(endpoint,), **overrides)
    with ExitStack() as stack:
        radio = stack.enter_context(SlowLink(int(endpoint.rpartition(":")[2]), link))
        vehicle = stack.enter_context(StreamVehicle(VEHICLE, settings))
        station, near = _Station(MonotonicClock()), f"tcp/127.0.0.1:{radio.port}"
        scans = stack.enter_context(open_session((), (near,), None, Role.STATION))
        scans.declare_subscriber(keys.key(VEHICLE, keys.SCAN), station.take)
        if one_session:
            for topic in (keys.DEPTH, keys.CAMERA):
                scans.declare_subscriber(keys.key(VEHICLE, topic), station.take)
        else:
            pictures = stack.enter_context(open_session((), (near,), None, Role.STATION))
            receiver = PictureReceiver(pictures, VEHICLE, station.hear, MonotonicClock())
            stack.callback(receiver.close)
        pause = threading.Event()
        pause.wait(settling_s)
        settling, before = station.heard(), radio.carried_bytes
        radio.forget_queue()
        pause.wait(seconds)
        heard, carried, queue_s = station.heard(), radio.carried_bytes - before, radio.largest_queue_s
        if keys.SCAN not in heard:
            raise PublisherError("no scan has arrived")
        return StreamFigures(
            profile=settings.profile,
            link_kbit_per_s=link.bits_per_s / 1e3,
            offered_kbit_per_s=round(vehicle.offered_kbit_per_s),
            carried_kbit_per_s=round(8e-3 * carried / seconds),
            longest_queue_ms=round(1e3 * queue_s, 1),
            settling={topic: value.figures(settling_s) for topic, value in sorted(settling.items())},
            topics={topic: value.figures(seconds) for topic, value in sorted(heard.items())},
        )
