"""The demo's own parts: radar, truth, verdict, and its ground station over real Zenoh."""

from __future__ import annotations

import dataclasses
import json
import math
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from service.clock import MonotonicClock
from service.demo.command import DEFAULT_SCENE
from service.demo.flight import nearest_ahead_m
from service.demo.observer import GroundObserver
from service.demo.picture import draw_side_by_side
from service.demo.plan import (
    ABOVE_M,
    BELOW_M,
    MARGIN_M,
    DemoPlan,
    free_zenoh_endpoint,
    write_configuration,
)
from service.demo.radar import CLEAR_BGR, OBSTACLE_BGR, draw_radar
from service.demo.report import DemoReport, Latency
from service.demo.truth import true_distance_ahead_m
from service.publisher import keys
from service.publisher.received import ReceivedReport
from service.publisher.session import open_session
from service.publisher.wire import CameraHeader, DepthHeader, Intrinsics, ScanSample
from service.settings.load import load_settings
from uavdepth.camera import CameraModel
from uavdepth.depth.codec import encode_depth_png
from uavdepth.scan.obstacle_scan import ObstacleScan, SectorState, sector_bearings_deg
from uavdepth.scenes import Scene, load_scene, parse_scene

PLAN = DemoPlan("wall:1000", "ardupilot", False, 3.0, 3.0, 30.0, "default")
REPORT = DemoReport(
    scene="wall:1000",
    flavor="ardupilot",
    blind=False,
    frames=100,
    fps=12.0,
    obstacle_messages=90,
    obstacle_rate_hz=12.0,
    latency_ms=Latency(90.0, 120.0),
    flew=True,
    stopped=True,
    collided=False,
    stop_distance_m=4.0,
    true_distance_m=4.1,
    zenoh_samples=300,
    flown_s=15.0,
    reason="came to rest in front of it",
)


def scan_with(distances_m: dict[int, float], clear: Sequence[int] = ()) -> ObstacleScan:
    """A scan by bearing in degrees; everything else unknown."""
    bearings = sector_bearings_deg()
    distance = np.full(72, np.nan, np.float32)
    state = np.full(72, SectorState.UNKNOWN, np.uint8)
    for bearing_deg, distance_m in distances_m.items():
        distance[bearings == bearing_deg] = distance_m
        state[bearings == bearing_deg] = SectorState.OBSTACLE
    for bearing_deg in clear:
        state[bearings == bearing_deg] = SectorState.CLEAR
    return ObstacleScan(distance, state, bearings, 0.2, 20.0)


class FlatWall:
    """Flat ground and a wall across the north axis."""

    def __init__(self, north_m: float) -> None:
        self.north_m = north_m

    def ground_height_m(self, north_m: float, east_m: float) -> float:
        return 0.0

    def ray_distance_m(self, origin_ned_m: Any, direction_ned: Any) -> Any:
        ahead = np.maximum(np.asarray(direction_ned)[:, 0], 1e-9)
        distance = (self.north_m - np.asarray(origin_ned_m)[:, 0]) / ahead
        return np.where(distance < 1e4, distance, math.inf)


class TestRadar:
    def test_an_obstacle_ahead_is_orange_above_the_vehicle_and_blue_before_it(self) -> None:
        picture = draw_radar(scan_with({0: 10.0, 5: 10.0, -5: 10.0}), 400)
        centre_x, centre_y, radius = 200, 224, 168
        beyond = picture[centre_y - round(radius * 0.7), centre_x]
        before = picture[centre_y - round(radius * 0.3), centre_x]
        np.testing.assert_allclose(beyond, OBSTACLE_BGR, atol=12)
        np.testing.assert_allclose(before, CLEAR_BGR, atol=12)

    def test_right_is_right(self) -> None:
        picture = draw_radar(scan_with({45: 5.0, 40: 5.0, 50: 5.0}), 400).astype(int)
        orange = np.abs(picture - OBSTACLE_BGR).sum(axis=-1) < 30
        columns = np.nonzero(orange)[1]
        assert columns.size
        assert columns.min() > 200

    def test_unknown_is_drawn_apart_from_clear(self) -> None:
        unknown = draw_radar(scan_with({}), 200)
        clear = draw_radar(scan_with({}, clear=range(-45, 50, 5)), 200)
        assert np.abs(unknown.astype(int) - clear).max() > 60

    def test_no_scan_is_no_empty_radar(self) -> None:
        assert np.abs(draw_radar(None, 200).astype(int) - draw_radar(scan_with({}), 200)).max() > 60

    def test_rows_of_pictures_that_fit_different_links_lie_below_each_other(self) -> None:
        rows = [
            draw_side_by_side(
                np.zeros((*image, 3), np.uint8), np.full(depth, 5.0, np.float32), scan_with({}), 1.0, 60.0
            )
            for image, depth in (((200, 320), (200, 320)), ((50, 80), (66, 106)))
        ]
        assert rows[0].shape == rows[1].shape
        assert rows[0].shape[1] > 2 * 320 * 360 / 200 + 360, "three panels"


class TestTruth:
    def test_the_wall_straight_ahead_is_nearest(self) -> None:
        assert true_distance_ahead_m(FlatWall(30.0), (20.0, 0.0, -3.0), 0.0, 2.0, 1.5) == pytest.approx(10.0)

    def test_with_the_back_to_the_wall_there_is_nothing(self) -> None:
        assert true_distance_ahead_m(FlatWall(30.0), (20.0, 0.0, -3.0), math.pi, 2.0, 1.5) is None


class TestDefaultScene:
    """ArduPilot keeps its margin to both sides too, and rests beside what is nearer."""

    @pytest.fixture(autouse=True)
    def rendered_worlds(self) -> None:
        pytest.importorskip("embreex", reason="rendered worlds need the extra sim")

    def nearest_aside_m(self, scene: Scene, north_m: float) -> float:
        """Within 20 to 100 degrees of the nose."""
        found = [
            true_distance_ahead_m(scene, (north_m, 0.0, -3.0), math.radians(bearing), BELOW_M, ABOVE_M)
            for bearing in (-80.0, -40.0, 40.0, 80.0)
        ]
        return min(distance for distance in found if distance is not None)

    def test_its_street_is_wider_than_the_margin_up_to_the_facade(self) -> None:
        city = load_scene(*parse_scene(DEFAULT_SCENE))
        facade_m = true_distance_ahead_m(city, (0.0, 0.0, -3.0), 0.0, BELOW_M, ABOVE_M)
        assert facade_m is not None
        assert facade_m > 20.0
        for north_m in np.arange(0.0, facade_m - 3.0 * MARGIN_M, 2.0):
            assert self.nearest_aside_m(city, float(north_m)) > 1.5 * MARGIN_M

    def test_the_measure_tells_a_narrow_street(self) -> None:
        assert self.nearest_aside_m(load_scene("city", 1003), 5.5) < 1.5 * MARGIN_M


class TestVerdict:
    def test_a_stop_without_touching_passes(self) -> None:
        assert REPORT.passed

    @pytest.mark.parametrize(
        "change",
        [{"collided": True}, {"stopped": False}, {"flew": False}],
        ids=lambda change: next(iter(change)),
    )
    def test_anything_else_fails(self, change: dict[str, bool]) -> None:
        assert not dataclasses.replace(REPORT, **change).passed

    def test_nearest_ahead_looks_ahead_only(self) -> None:
        sample = ScanSample.of(
            scan_with({0: 7.0, 10: 6.0, 45: 2.0}), index=0, captured_ns=0, age_ms=1.0, trouble=None
        )
        assert nearest_ahead_m(sample) == pytest.approx(6.0)


class TestConfiguration:
    def test_the_service_takes_the_file_that_the_demo_writes(self, tmp_path: Path) -> None:
        path = write_configuration(tmp_path, PLAN, "tcp:127.0.0.1:5760", "tcp/127.0.0.1:7447")
        settings = load_settings(path)
        assert settings.camera.source == "sim:wall:1000"
        assert settings.autopilot.endpoint == "tcp:127.0.0.1:5760"


class TestObserver:
    def test_it_sees_scans_and_pictures_over_a_real_session(self) -> None:
        endpoint = free_zenoh_endpoint()
        camera = CameraModel.from_fov(64, 32, 90.0)
        depth_m = np.full((32, 64), 7.0, np.float32)
        stamp = {"index": 3, "captured_ns": 1, "age_ms": 2.0}
        scan = ScanSample.of(scan_with({0: 7.0}), index=3, captured_ns=1, age_ms=2.0, trouble=None)
        depth = DepthHeader(**stamp, near_m=0.5, far_m=60.0, camera=Intrinsics.of(camera))  # type: ignore[arg-type]
        picture = CameraHeader(**stamp, camera=Intrinsics.of(camera))  # type: ignore[arg-type]
        jpeg = cv2.imencode(".jpg", np.full((32, 64, 3), 90, np.uint8))[1].tobytes()
        reports: list[bytes] = []
        with open_session((endpoint,), ()) as session:
            session.declare_subscriber(
                keys.key("demo", keys.RECEIVED), lambda sample: reports.append(sample.payload.to_bytes())
            )
            observer = GroundObserver("demo", endpoint, MonotonicClock())
            try:
                until_s = time.monotonic() + 20.0
                while observer.pictures() is None or observer.scan is None or not reports:
                    session.put(keys.key("demo", keys.SCAN), scan.encode())
                    session.put(
                        keys.key("demo", keys.DEPTH),
                        encode_depth_png(depth_m, 0.5, 60.0),
                        attachment=depth.encode(),
                    )
                    session.put(keys.key("demo", keys.CAMERA), jpeg, attachment=picture.encode())
                    assert time.monotonic() < until_s, "nothing came over Zenoh"
                    time.sleep(0.05)
                seen = observer.pictures()
                assert seen is not None
                assert observer.samples >= 3
                assert ReceivedReport.decode(reports[0]).topic in (keys.DEPTH, keys.CAMERA)
                np.testing.assert_allclose(seen.depth_m, 7.0, rtol=0.02)
                assert seen.image_bgr.shape == (32, 64, 3)
            finally:
                observer.close()


class TestBlind:
    def test_without_the_service_it_hits_the_wall_and_says_so_with_exit_code_1(self, tmp_path: Path) -> None:
        pytest.importorskip("embreex", reason="rendered worlds need the extra sim")
        words = [
            "demo",
            "--blind",
            "--json",
            "--scene",
            "wall:1000",
            "--speed",
            "5",
            "--output",
            str(tmp_path),
        ]
        done = subprocess.run(
            [sys.executable, "-m", "service", *words],
            capture_output=True,
            text=True,
            timeout=150,
            check=False,
        )
        assert done.returncode == 1
        assert done.stdout, done.stderr
        report = json.loads(done.stdout)
        assert report["collided"] is True
        assert report["stopped"] is False
        assert report["obstacle_messages"] == 0
