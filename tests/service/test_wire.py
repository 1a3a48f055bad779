"""The samples' text: what was written is read, anything else is refused."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from service.publisher.keys import key, vehicle_of
from service.publisher.rate_limit import RateLimit
from service.publisher.status_wire import StatusSample
from service.publisher.wire import CameraHeader, DepthHeader, Intrinsics, ScanSample, WireError
from uavdepth.camera import CameraModel
from uavdepth.scan.obstacle_scan import SECTOR_COUNT, ObstacleScan, SectorState, sector_bearings_deg

CAMERA = CameraModel(64, 48, 50.0, 51.0, 31.5, 23.5, (0.1, 0.0, 0.0, 0.0))


def scan_of(states: list[int], distance_m: float = 4.567) -> ObstacleScan:
    state = np.array(states, np.uint8)
    distance = np.where(state == SectorState.OBSTACLE, distance_m, np.nan).astype(np.float32)
    return ObstacleScan(distance, state, sector_bearings_deg(), 0.2, 20.0)


def sample_of(scan: ObstacleScan, trouble: str | None = None) -> ScanSample:
    return ScanSample.of(scan, index=3, captured_ns=5, age_ms=40.5, trouble=trouble)


states = st.lists(st.integers(0, 2), min_size=SECTOR_COUNT, max_size=SECTOR_COUNT)


@given(states, st.floats(0.0, 600.0))
def test_a_scan_survives_the_way_and_no_distance_grows(values: list[int], distance_m: float) -> None:
    scan = scan_of(values, distance_m)
    back = ScanSample.decode(sample_of(scan).encode()).scan
    np.testing.assert_array_equal(back.state, scan.state)
    obstacle = scan.state == SectorState.OBSTACLE
    assert np.all(np.isnan(back.distance_m[~obstacle]))
    assert np.all(back.distance_m[obstacle] <= scan.distance_m[obstacle] + 1e-4)
    assert np.all(scan.distance_m[obstacle] - back.distance_m[obstacle] < 0.0101)
    np.testing.assert_array_equal(back.bearing_deg, scan.bearing_deg)


def test_an_untrusted_scan_says_why() -> None:
    back = ScanSample.decode(sample_of(scan_of([0] * 72), "no height above ground").encode())
    assert (back.trusted, back.trouble) == (False, "no height above ground")


def changed(**changes: Any) -> bytes:
    document = json.loads(sample_of(scan_of([2] + [0] * 71)).encode())
    document.update(changes)
    return json.dumps(document).encode()


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"\xff\xfe",
        b"null",
        b"[]",
        b"{}",
        changed(version=2),
        changed(state="2" * 71),
        changed(state="3" * 72),
        changed(state="0" * 72),
        changed(distance_cm=[1] * 72),
        changed(distance_cm=[100]),
        changed(age_ms=-1),
        changed(max_distance_m="NaN"),
        changed(index=-1),
        b" " * 100_000,
    ],
)
def test_a_broken_scan_is_refused_by_name(data: bytes) -> None:
    with pytest.raises(WireError, match="ScanSample"):
        ScanSample.decode(data)


@given(st.binary(max_size=300))
def test_no_bytes_raise_anything_else(data: bytes) -> None:
    for kind in (ScanSample, StatusSample, DepthHeader, CameraHeader):
        with pytest.raises(WireError):
            kind.decode(data)


def test_a_reader_of_this_version_is_not_disturbed_by_new_keys() -> None:
    assert ScanSample.decode(changed(wind="strong")).state.startswith("2")


def test_a_depth_header_carries_what_metres_need() -> None:
    header = DepthHeader(index=1, captured_ns=2, age_ms=3, near_m=0.5, far_m=60, camera=Intrinsics.of(CAMERA))
    back = DepthHeader.decode(header.encode())
    assert back == header
    assert (back.version, back.encoding, back.camera.distortion) == (1, "log8-png", (0.1, 0.0, 0.0, 0.0))


@pytest.mark.parametrize(
    ("text", "vehicle"),
    [
        (key("uav1", "scan"), "uav1"),
        ("other/uav1/scan", None),
        ("uavdepth/scan", None),
        ("", None),
        (key("no name", "scan"), None),
        (key("v" * 65, "scan"), None),
    ],
)
def test_keys_name_their_vehicle(text: str, vehicle: str | None) -> None:
    assert vehicle_of(text) == vehicle


def test_a_rate_limit_keeps_the_mean_of_an_uneven_source() -> None:
    limit = RateLimit(10.0)
    passed = sum(limit.allows(at_ms * 1_000_000) for at_ms in range(0, 10_000, 33))
    assert 95 <= passed <= 101


def test_a_rate_limit_does_not_catch_up_after_a_pause() -> None:
    limit = RateLimit(10.0)
    assert limit.allows(0)
    assert limit.allows(60_000_000_000)
    assert [limit.allows(60_000_000_000 + ms * 1_000_000) for ms in (1, 40, 60, 100)] == [
        False,
        False,
        True,
        False,
    ]
