"""What the ground station makes of samples, hostile ones included."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from ground_support import (
    MILLISECOND,
    SECOND,
    camera_header,
    depth_header,
    depth_png,
    jpeg,
    scan_sample,
    status_sample_of,
)
from hypothesis import given, settings
from hypothesis import strategies as st

from service.clock import ManualClock
from service.freshness import Freshness
from service.ground.errors import PictureError
from service.ground.fleet import MAX_VEHICLES, Fleet
from service.ground.history import HistoryPoint, NearestHistory, Reading, Verdict, reading_of
from service.ground.pictures import MAX_PICTURE_BYTES, check_grey_png, check_jpeg

KITE = "uavdepth/kite/"


def fleet_of(clock: ManualClock | None = None) -> tuple[Fleet, ManualClock]:
    clock = ManualClock(100 * SECOND) if clock is None else clock
    return Fleet(clock), clock


def test_a_scan_and_a_status_make_a_vehicle() -> None:
    fleet, clock = fleet_of()
    fleet.hear(KITE + "scan", scan_sample(6.0, bearing_deg=20).encode(), None)
    fleet.hear(KITE + "status", status_sample_of("kite").encode(), None)
    (view,) = fleet.views()
    assert view.reading == Reading(Verdict.OBSTACLE, 600, 20.0)
    assert view.status is not None
    assert view.status.speed_mps == 2.1
    assert view.freshness(clock.now_ns()) is Freshness.LIVE
    clock.advance_s(1.0)
    assert view.freshness(clock.now_ns()) is Freshness.STALE
    clock.advance_s(2.0)
    assert view.freshness(clock.now_ns()) is Freshness.NO_DATA


def test_a_living_session_is_no_sign_of_fresh_data() -> None:
    fleet, clock = fleet_of()
    fleet.hear_alive(KITE + "alive", True)
    (view,) = fleet.views()
    assert view.alive
    assert view.freshness(clock.now_ns()) is Freshness.NO_DATA


def test_a_scan_that_waited_on_the_link_is_stale_when_it_arrives() -> None:
    fleet, clock = fleet_of()
    fleet.hear(KITE + "scan", scan_sample(captured_ns=0).encode(), None)
    clock.advance_s(2.1)
    fleet.hear(KITE + "scan", scan_sample(captured_ns=100 * MILLISECOND).encode(), None)
    (view,) = fleet.views()
    assert view.freshness(clock.now_ns()) is Freshness.STALE


def test_an_untrusted_scan_and_one_that_sees_nothing_are_unknown_and_never_clear() -> None:
    assert reading_of(scan_sample(trouble="no height above ground")).verdict is Verdict.UNKNOWN
    blind = scan_sample().model_copy(update={"state": "0" * 72, "distance_cm": (-1,) * 72})
    assert reading_of(blind).verdict is Verdict.UNKNOWN
    assert reading_of(scan_sample(None)).verdict is Verdict.CLEAR


def test_pictures_are_handed_on_as_they_came() -> None:
    fleet, _ = fleet_of()
    fleet.hear(KITE + "camera", jpeg(200), camera_header().encode())
    fleet.hear(KITE + "depth", depth_png(7.0), depth_header().encode())
    camera, depth = fleet.picture("kite", "camera"), fleet.picture("kite", "depth")
    assert camera is not None
    assert depth is not None
    assert (camera.data, camera.number) == (jpeg(200), 1)
    assert (depth.data, depth.header) == (depth_png(7.0), depth_header())
    fleet.forget_pictures({"other"})
    assert fleet.picture("kite", "camera") is None


@pytest.mark.parametrize(
    ("topic", "payload", "attachment", "words"),
    [
        ("scan", b"\x00", None, "ScanSample"),
        ("scan", b" " * 70_000, None, "65536"),
        ("status", b"{}", None, "StatusSample"),
        ("camera", jpeg(1), None, "CameraHeader"),
        ("camera", depth_png(3.0), camera_header().encode(), "no JPEG"),
        ("depth", jpeg(1), depth_header().encode(), "no PNG"),
        ("depth", depth_png(3.0), b"{" * 5000, "DepthHeader"),
        (
            "depth",
            depth_png(3.0),
            depth_header().model_copy(update={"far_m": 1e300}).encode(),
            "can be shown",
        ),
        ("depth", depth_png(3.0), depth_header().model_copy(update={"far_m": 0.1}).encode(), "can be shown"),
        ("camera", b"\xff\xd8" + bytes(MAX_PICTURE_BYTES), camera_header().encode(), "at most"),
        ("wind", b"1", None, "not shown"),
    ],
)
def test_what_is_not_understood_is_counted_and_changes_nothing(
    topic: str, payload: bytes, attachment: bytes | None, words: str
) -> None:
    fleet, _ = fleet_of()
    fleet.hear(KITE + topic, payload, attachment)
    assert fleet.bad_samples.count == 1
    assert words in fleet.bad_samples.last
    assert all(view.scan is None and view.status is None for view in fleet.views())
    assert fleet.picture("kite", topic) is None


@pytest.mark.parametrize("name", ["", "*", "a b", "<script>", "x" * 65, "kite$"])
def test_names_that_no_vehicle_can_have_are_refused(name: str) -> None:
    fleet, _ = fleet_of()
    fleet.hear(f"uavdepth/{name}/scan", scan_sample().encode(), None)
    assert fleet.views() == []


def test_invented_vehicles_do_not_push_out_real_ones() -> None:
    fleet, clock = fleet_of()
    for number in range(MAX_VEHICLES):
        fleet.hear(f"uavdepth/v{number}/scan", scan_sample().encode(), None)
    fleet.hear("uavdepth/late/scan", scan_sample().encode(), None)
    assert len(fleet.views()) == MAX_VEHICLES
    assert fleet.view("late") is None
    clock.advance_s(4.0)
    for number in range(1, MAX_VEHICLES):
        fleet.hear(f"uavdepth/v{number}/scan", scan_sample().encode(), None)
    fleet.hear("uavdepth/late/scan", scan_sample().encode(), None)
    assert fleet.view("late") is not None
    assert fleet.view("v0") is None  # the one that fell silent


def test_a_flood_of_one_vehicle_is_read_only_in_part() -> None:
    fleet, clock = fleet_of()
    for _ in range(1000):
        fleet.hear(KITE + "scan", scan_sample().encode(), None)
    assert fleet.changes("kite") == 120
    assert fleet.bad_samples.count == 880
    clock.advance_s(1.0)
    fleet.hear(KITE + "scan", scan_sample().encode(), None)
    assert fleet.changes("kite") == 121


def test_traffic_is_told_by_the_second() -> None:
    fleet, clock = fleet_of()
    sample = scan_sample().encode()
    for _ in range(41):
        fleet.hear(KITE + "scan", sample, None)
        clock.advance_s(0.1)
    view = fleet.view("kite")
    assert view is not None
    assert view.traffic.samples_per_s["scan"] == pytest.approx(10.0, abs=1.0)
    assert view.traffic.bytes_per_s == pytest.approx(10.0 * len(sample), rel=0.1)


def test_history_keeps_the_nearest_of_each_quarter_second_and_unknown_is_not_lost_in_clear() -> None:
    history = NearestHistory()
    for at_ms, reading in [
        (0, Reading(Verdict.OBSTACLE, 900)),
        (100, Reading(Verdict.OBSTACLE, 500)),
        (200, Reading(Verdict.CLEAR)),
        (300, Reading(Verdict.CLEAR)),
        (400, Reading(Verdict.UNKNOWN)),
    ]:
        history.hear(reading, at_ms * MILLISECOND)
    assert [(point.verdict, point.nearest_cm) for point in history.points(SECOND)] == [
        (Verdict.OBSTACLE, 500),
        (Verdict.UNKNOWN, -1),
    ]


def test_history_is_two_minutes_long() -> None:
    history = NearestHistory()
    for second in range(400):
        history.hear(Reading(Verdict.OBSTACLE, second), second * SECOND)
    points = history.points(400 * SECOND)
    assert points[0] == HistoryPoint(280 * SECOND, Verdict.OBSTACLE, 280)
    assert len(points) == 120


def test_headers_of_pictures_tell_their_size() -> None:
    assert check_jpeg(jpeg(9)) == (64, 40)
    assert check_grey_png(depth_png(3.0)) == (64, 40)
    colour = cv2.imencode(".png", np.zeros((4, 4, 3), np.uint8))[1].tobytes()
    with pytest.raises(PictureError, match="8-bit grey"):
        check_grey_png(colour)


def test_a_picture_that_would_fill_a_browsers_memory_is_refused_by_its_header() -> None:
    huge = bytearray(depth_png(3.0))
    huge[16:24] = (60_000).to_bytes(4) * 2
    with pytest.raises(PictureError, match="60000x60000"):
        check_grey_png(bytes(huge))
    wide = bytearray(jpeg(3))
    at = wide.index(b"\xff\xc0")
    wide[at + 5 : at + 9] = b"\xff\xff\xff\xff"
    with pytest.raises(PictureError, match="65535x65535"):
        check_jpeg(bytes(wide))


@settings(max_examples=300)
@given(st.binary(max_size=400), st.sampled_from([b"", b"\xff\xd8", b"\xff\xd8\xff\xe0", depth_png(3.0)[:26]]))
def test_no_bytes_break_the_header_checks(tail: bytes, head: bytes) -> None:
    for check in (check_jpeg, check_grey_png):
        try:
            width, height = check(head + tail)
        except PictureError:
            continue
        assert 1 <= width <= 4096
        assert 1 <= height <= 4096


@settings(max_examples=300)
@given(
    st.sampled_from(["scan", "status", "camera", "depth", "alive", "", "a/b"]),
    st.binary(max_size=300) | st.sampled_from([jpeg(1), depth_png(2.0), scan_sample().encode()]),
    st.none()
    | st.binary(max_size=200)
    | st.sampled_from([camera_header().encode(), depth_header().encode()]),
)
def test_no_sample_breaks_the_fleet(topic: str, payload: bytes, attachment: bytes | None) -> None:
    fleet, _ = fleet_of()
    fleet.hear(KITE + topic, payload, attachment)
    fleet.hear(KITE + "scan", scan_sample().encode(), None)
    assert [view.name for view in fleet.views()] == ["kite"]
