"""The Zenoh publisher, heard by a second session over the loopback."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import zenoh
from program_fakes import free_port, wait_until, wall_over_ground
from publisher_support import Heard, listening, publishing, result_of, settings_on

from service.clock import ManualClock, MonotonicClock
from service.publisher.picture_receiver import PictureReceiver
from service.publisher.publisher import ZenohPublisher
from service.publisher.session import MAX_MESSAGE_BYTES, Role, open_session
from service.publisher.status_wire import StatusSample
from service.publisher.topics import PictureTopics
from service.publisher.wire import CameraHeader, DepthHeader, ScanSample
from service.trouble import Trouble
from uavdepth.depth.codec import decode_depth_png
from uavdepth.depth.depth_map import DepthMap

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
