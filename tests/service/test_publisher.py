"""The Zenoh publisher, heard by a second session over the loopback."""

from __future__ import annotations

import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import zenoh
from program_fakes import free_port, make_settings, picture, wait_until, wall_over_ground

from service.clock import ManualClock, MonotonicClock
from service.errors import PublisherError
from service.frame import Frame
from service.pipeline import PerceptionResult, unknown_scan
from service.publisher.picture_receiver import PictureReceiver
from service.publisher.publisher import ZenohPublisher
from service.publisher.session import MAX_MESSAGE_BYTES, Role, open_session
from service.publisher.topics import PictureTopics
from service.publisher.wire import CameraHeader, DepthHeader, ScanSample, StatusSample
from service.scale_status import ScaleStatus
from service.security.errors import SecurityError
from service.settings import Settings
from service.settings.zenoh import ZenohSettings
from service.telemetry import Telemetry
from service.trouble import Trouble
from uavdepth.depth_codec import decode_depth_png
from uavdepth.depth_map import DepthMap

STATUS = StatusSample(
    vehicle="kite",
    state="ACTIVE",
    uptime_s=1.0,
    frames_per_s=15.0,
    obstacle_messages=3,
    camera="delivering",
    link_connected=True,
    memory_mib=100.0,
)


def settings_on(port: int, *overrides: str) -> Settings:
    return make_settings(
        "zenoh.enabled=true", "vehicle.name=kite", f"zenoh.listen=['tcp/127.0.0.1:{port}']", *overrides
    )


def result_of(settings: Settings, index: int = 0, trouble: Trouble | None = None) -> PerceptionResult:
    depth = DepthMap(wall_over_ground(settings.camera.model, 8.0))
    frame = Frame(picture(200), 1_000 + index, index)
    return PerceptionResult(
        frame, Telemetry(0), depth, ScaleStatus(4.0, 0.05, 0.0), unknown_scan(0.2, 20.0), trouble
    )


class Heard:
    """Samples by topic, and liveliness."""

    def __init__(self, session: zenoh.Session, vehicle: str = "kite") -> None:
        self.samples: dict[str, list[zenoh.Sample]] = {}
        self.alive: list[bool] = []
        session.declare_subscriber(f"uavdepth/{vehicle}/*", self._hear)
        session.liveliness().declare_subscriber(
            f"uavdepth/{vehicle}/alive",
            lambda sample: self.alive.append(sample.kind == zenoh.SampleKind.PUT),
            history=True,
        )

    def _hear(self, sample: zenoh.Sample) -> None:
        self.samples.setdefault(str(sample.key_expr).rpartition("/")[2], []).append(sample)

    def has(self, *topics: str) -> bool:
        return all(self.samples.get(topic) for topic in topics)


@contextmanager
def publishing(settings: Settings) -> Iterator[ZenohPublisher]:
    publisher = ZenohPublisher(settings.zenoh, settings.vehicle.name, settings.camera.model, MonotonicClock())
    publisher.start()
    try:
        yield publisher
    finally:
        publisher.close()


@contextmanager
def listening(port: int) -> Iterator[Heard]:
    with open_session([], [f"tcp/127.0.0.1:{port}"]) as session:
        yield Heard(session)


def test_a_ground_station_gets_scan_depth_camera_and_status() -> None:
    port = free_port()
    settings = settings_on(port)
    with publishing(settings) as publisher, listening(port) as heard:
        wait_until(lambda: publisher.status.peers == 1)
        wait_until(lambda: heard.alive == [True])

        def offer() -> bool:
            publisher.offer(result_of(settings))
            publisher.offer_status(STATUS)
            return heard.has("scan", "depth", "camera", "status")

        wait_until(offer)
        scan = ScanSample.decode(heard.samples["scan"][0].payload.to_bytes())
        assert scan.trusted
        assert StatusSample.decode(heard.samples["status"][0].payload.to_bytes()) == STATUS

        depth = heard.samples["depth"][0]
        assert depth.attachment is not None
        header = DepthHeader.decode(depth.attachment.to_bytes())
        assert (header.index, header.captured_ns, header.scale_factor) == (0, 1_000, 4.0)
        metres = decode_depth_png(depth.payload.to_bytes(), header.near_m, header.far_m)
        truth = wall_over_ground(settings.camera.model, 8.0)
        assert metres.shape == truth.shape == (header.camera.height, header.camera.width)
        np.testing.assert_allclose(metres, truth, rtol=0.03)
        assert np.all(metres <= truth)
        assert depth.encoding == zenoh.Encoding.IMAGE_PNG

        camera = heard.samples["camera"][0]
        assert camera.attachment is not None
        assert CameraHeader.decode(camera.attachment.to_bytes()).camera.width == settings.camera.width
        assert camera.payload.to_bytes()[:2] == b"\xff\xd8"


def test_a_thin_stream_arrives_as_pictures_that_any_browser_shows() -> None:
    port = free_port()
    settings = settings_on(port, "zenoh.profile=thin", "zenoh.camera=false")
    heard: list[tuple[str, bytes, bytes | None]] = []
    with publishing(settings) as publisher, open_session([], [f"tcp/127.0.0.1:{port}"]) as session:
        receiver = PictureReceiver(session, "kite", lambda *sample: heard.append(sample), MonotonicClock())
        index = 0

        def offer() -> bool:
            nonlocal index
            index += 1
            publisher.offer(result_of(settings, index))
            return bool(heard) and publisher.status.picture_delay_ms is not None

        wait_until(offer)
        receiver.close()
    key, png, attachment = heard[0]
    assert key == "uavdepth/kite/depth"
    header = DepthHeader.decode(attachment or b"")
    metres = decode_depth_png(png, header.near_m, header.far_m)
    truth = wall_over_ground(settings.camera.model, 8.0)
    assert metres.shape == truth.shape
    np.testing.assert_allclose(np.median(metres / truth), 1.0, atol=0.05)


def test_scan_only_sends_no_pictures() -> None:
    port = free_port()
    settings = settings_on(port, "zenoh.profile=scan-only")
    with publishing(settings) as publisher, listening(port) as heard:

        def offer() -> bool:
            publisher.offer(result_of(settings))
            return len(heard.samples.get("scan", [])) >= 5

        wait_until(offer)
        assert set(heard.samples) == {"scan"}


def test_a_vehicle_that_connects_has_a_session_for_scans_and_one_for_pictures() -> None:
    port = free_port()
    settings = settings_on(port, "zenoh.listen=[]", f"zenoh.connect=['tcp/127.0.0.1:{port}']")
    with open_session([f"tcp/127.0.0.1:{port}"], [], None, Role.STATION) as station:
        heard = Heard(station)
        with publishing(settings) as publisher:

            def offer() -> bool:
                publisher.offer(result_of(settings))
                return heard.has("scan", "depth", "camera")

            wait_until(offer)
            assert len(list(station.info.peers_zid())) == 2


def test_what_is_not_understood_as_a_report_changes_nothing() -> None:
    port = free_port()
    settings = settings_on(port)
    with publishing(settings) as publisher, listening(port) as heard:
        wait_until(lambda: heard.alive == [True])
        with open_session([], [f"tcp/127.0.0.1:{port}"]) as hostile:
            for data in (b"", b"{}", b"[" * 60_000, b"\xff" * 1000):
                hostile.put("uavdepth/kite/received", data)

            def offer() -> bool:
                publisher.offer(result_of(settings))
                return heard.has("scan", "depth")

            wait_until(offer)
        assert publisher.status.detail == ""


def test_what_is_far_too_large_is_not_even_received() -> None:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    with open_session([endpoint], []) as vehicle, open_session([], [endpoint]) as hostile:
        sizes: list[int] = []
        vehicle.declare_subscriber("uavdepth/kite/received", lambda sample: sizes.append(len(sample.payload)))

        def put() -> bool:
            hostile.put("uavdepth/kite/received", bytes(MAX_MESSAGE_BYTES + 100_000))
            hostile.put("uavdepth/kite/received", b"x")
            return len(sizes) >= 2

        wait_until(put)
        assert set(sizes) == {1}


def test_topics_that_are_declared_anew_hear_each_report_once() -> None:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    with open_session([endpoint], []) as session, open_session([], [endpoint]) as station:
        heard: list[str] = []
        for name in ("first", "second", "third"):
            topics = PictureTopics(session, "kite", lambda _sample, name=name: heard.append(name))
            if name != "third":
                topics.close()

        def put() -> bool:
            station.put("uavdepth/kite/received", b"x")
            return len(heard) >= 2

        wait_until(put)
        assert set(heard) == {"third"}


def test_certificates_that_cannot_be_used_stop_the_program_with_the_file(tmp_path: Path) -> None:
    table = {name: str(tmp_path / name) for name in ("ca", "certificate", "key")}
    settings = ZenohSettings(listen=("tls/127.0.0.1:7447",), **table)
    with pytest.raises(SecurityError, match=r"ca .*: no such file"):
        ZenohPublisher(settings, "kite", make_settings().camera.model, MonotonicClock())


def test_liveliness_goes_with_the_publisher() -> None:
    port = free_port()
    with publishing(settings_on(port)) as publisher, listening(port) as heard:
        wait_until(lambda: heard.alive == [True])
        publisher.close()
        wait_until(lambda: heard.alive == [True, False])


def test_without_scale_no_depth_is_published_and_the_scan_says_why() -> None:
    port = free_port()
    settings = settings_on(port, "zenoh.camera=false")
    with publishing(settings) as publisher, listening(port) as heard:
        wait_until(lambda: publisher.status.peers == 1)

        def offer() -> bool:
            publisher.offer(replace(result_of(settings, trouble=Trouble.NO_HEIGHT), depth=None, scale=None))
            return len(heard.samples.get("scan", [])) >= 3

        wait_until(offer)
        scan = ScanSample.decode(heard.samples["scan"][0].payload.to_bytes())
        assert (scan.trusted, scan.trouble) == (False, "no height above ground")
        assert set(heard.samples) == {"scan"}


def test_a_port_in_use_is_told_and_taken_when_it_is_free() -> None:
    blocker = socket.create_server(("127.0.0.1", 0))
    port = blocker.getsockname()[1]
    try:
        with publishing(settings_on(port)) as publisher:
            wait_until(lambda: "in use" in publisher.status.detail)
            assert f"tcp/127.0.0.1:{port} is in use by another program" in publisher.status.detail
            assert not publisher.status.open
            blocker.close()
            wait_until(lambda: publisher.status.open)
            assert publisher.status.detail == ""
    finally:
        blocker.close()


def test_a_peer_that_is_away_is_told_and_found_when_it_comes() -> None:
    port = free_port()
    settings = settings_on(port, "zenoh.listen=[]", f"zenoh.connect=['tcp/127.0.0.1:{port}']")
    with publishing(settings) as publisher:
        wait_until(lambda: "no peer at" in publisher.status.detail)
        with open_session([f"tcp/127.0.0.1:{port}"], []):
            wait_until(lambda: publisher.status.peers == 1)
            wait_until(lambda: publisher.status.detail == "")


class Stubborn:
    """A session whose peer has accepted and says nothing: it does not close."""

    closing = 0
    released = threading.Event()

    def __init__(self, session: zenoh.Session) -> None:
        self._session = session

    def __getattr__(self, name: str) -> Any:
        return getattr(self._session, name)

    def close(self) -> None:
        Stubborn.closing += 1
        self.released.wait()
        self._session.close()  # type: ignore[no-untyped-call]


def test_nobody_waits_for_sessions_that_do_not_close(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        "service.publisher.publisher.open_session", lambda *words: Stubborn(open_session(*words))
    )
    settings = settings_on(free_port(), f"zenoh.connect=['tcp/127.0.0.1:{free_port()}']")
    publisher = ZenohPublisher(settings.zenoh, "kite", settings.camera.model, MonotonicClock())
    publisher.start()
    wait_until(lambda: publisher.status.open)
    publisher.close()
    try:
        assert not Stubborn.released.is_set(), "it has come back and they are still there"
        wait_until(lambda: Stubborn.closing == 2)
    finally:
        Stubborn.released.set()


def test_offering_never_waits_even_if_nothing_is_published() -> None:
    settings = settings_on(free_port())
    publisher = ZenohPublisher(settings.zenoh, "kite", settings.camera.model, MonotonicClock())
    result = result_of(settings)
    for _ in range(1000):
        publisher.offer(result)
    assert publisher.dropped_count == 999
    publisher.close()


def test_a_result_that_cannot_be_encoded_does_not_end_the_publisher() -> None:
    port = free_port()
    settings = settings_on(port)
    broken = replace(result_of(settings), depth=DepthMap(np.zeros((0, 0), np.float32)))
    with publishing(settings) as publisher, listening(port) as heard:
        wait_until(lambda: publisher.status.open)
        publisher.offer(broken)
        wait_until(
            lambda: "DepthCodecError" in publisher.status.detail or "depth is" in publisher.status.detail
        )

        def offer() -> bool:
            publisher.offer(result_of(settings))
            return heard.has("depth")

        wait_until(offer)


def test_rates_are_kept_by_the_services_clock() -> None:
    port = free_port()
    settings = settings_on(port, "zenoh.scan_rate_hz=10", "zenoh.camera=false")
    clock = ManualClock(1_000_000_000)
    publisher = ZenohPublisher(settings.zenoh, "kite", settings.camera.model, clock)
    publisher.start()
    try:
        with listening(port) as heard:
            wait_until(lambda: heard.alive == [True])
            publisher.offer(result_of(settings, 0))
            wait_until(lambda: heard.has("scan", "depth"))
            publisher.offer(result_of(settings, 1))  # no time has passed: too soon
            publisher.offer_status(STATUS)
            wait_until(lambda: heard.has("status"))
            clock.advance_s(0.2)
            publisher.offer(result_of(settings, 2))
            wait_until(lambda: len(heard.samples["scan"]) == 2)
            indices = [ScanSample.decode(s.payload.to_bytes()).index for s in heard.samples["scan"]]
            assert indices == [0, 2]
    finally:
        publisher.close()


@pytest.mark.parametrize(
    ("listen", "words"),
    [
        ("tcp/203.0.113.7:7447", "is no address of this computer"),
        ("tcp/no-such-host.invalid:7447", "failed to lookup"),
        ("tcp/127.0.0.1:7447#so_sndbuf=much", "much"),
    ],
)
def test_an_endpoint_that_cannot_be_listened_on_is_named(listen: str, words: str) -> None:
    with pytest.raises(PublisherError, match=words) as refusal:
        open_session([listen], [])
    assert listen.split("#")[0] in str(refusal.value)
    assert ".rs:" not in str(refusal.value)


def test_sessions_do_not_find_each_other_by_themselves() -> None:
    with open_session([f"tcp/127.0.0.1:{free_port()}"], []) as one, open_session([], []) as other:
        heard = Heard(other)
        pause = threading.Event()
        for _ in range(10):
            one.put("uavdepth/kite/scan", b"x")
            pause.wait(0.02)
        assert heard.samples == {}
        assert list(one.info.peers_zid()) == []
