"""Several cameras make one message (R12); a side that fails is unknown, and said to be so."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from program_fakes import (
    FLYING_HEIGHT_M,
    FakeLink,
    FixedDepth,
    ScriptedCamera,
    make_settings,
    picture,
    wait_until,
    wall_over_ground,
)

from service.cameras.camera import Camera, PictureSizeError
from service.cameras.reader import CameraState, CameraStatus
from service.clock import MonotonicClock
from service.errors import CameraError, ConfigError
from service.frame import Frame
from service.health import SEVERITY_CRITICAL, SEVERITY_WARNING
from service.perception_result import PerceptionResult, unknown_scan
from service.pipeline import Perception, make_scanner
from service.publisher.status_wire import StatusSample
from service.replay.open_footage import open_flight
from service.run import Service
from service.settings import ExtraCameraSettings, Settings
from service.settings.load import load_settings
from service.settings.reference import reference_markdown
from service.side_cameras import SideCameras
from service.side_watch import SideWatch
from service.status import SideStatus
from service.status_sample import status_sample
from service.telemetry import Telemetry
from service.trouble import Trouble
from uavdepth.attitude import Attitude
from uavdepth.scale.estimator import ScaleEstimator
from uavdepth.scan.obstacle_scan import SectorState

AHEAD, RIGHT = 31, 31 + 18
"""Elements along the nose and at 90 degrees."""

WALL_M = 8.0


def settings_with_a_right_camera() -> Settings:
    plain = make_settings("scan.sigma_factor=0")
    right = ExtraCameraSettings.model_validate(
        {
            "name": "right",
            "camera": plain.camera.model_dump(),
            "mount": {"yaw_deg": 90.0},
        }
    )
    return plain.model_copy(update={"extra_camera": (right,)})


SETTINGS = settings_with_a_right_camera()
CAMERA = SETTINGS.camera.model


def main_perception() -> Perception:
    """A wall at 8 m before every camera that looks with this network."""
    model = FixedDepth(wall_over_ground(CAMERA, WALL_M))
    scale = ScaleEstimator(CAMERA, SETTINGS.mount.mount)
    return Perception(SETTINGS, model, scale, make_scanner(SETTINGS))


@contextmanager
def looking(link: FakeLink, camera: Camera) -> Iterator[tuple[SideCameras, Perception]]:
    sides = SideCameras(SETTINGS, link.clock, link, lambda extra: camera)
    perception = main_perception()
    sides.start(perception)
    try:
        yield sides, perception
    finally:
        sides.stop()


def endless(acts: list[np.ndarray | Exception] | None = None) -> ScriptedCamera:
    clock = MonotonicClock()
    return ScriptedCamera(SETTINGS, clock, [picture()] if acts is None else acts, forever=acts is None)


def look(perception: Perception, link: FakeLink) -> PerceptionResult:
    now_ns = link.clock.now_ns()
    return perception.step(Frame(picture(), now_ns, 0), link.telemetry_at(now_ns))


def test_r12_two_cameras_make_one_scan_with_the_obstacles_of_both() -> None:
    link = FakeLink(MonotonicClock())
    with looking(link, endless()) as (sides, perception):
        alone = look(perception, link)
        assert alone.scan.state[RIGHT] == SectorState.UNKNOWN
        wait_until(lambda: sides.added_to(look(perception, link)).scan.state[RIGHT] == SectorState.OBSTACLE)
        both = sides.added_to(look(perception, link))
    assert both.scan.state[AHEAD] == SectorState.OBSTACLE
    assert both.scan.distance_m[AHEAD] == pytest.approx(WALL_M, rel=0.05)
    assert both.scan.distance_m[RIGHT] == pytest.approx(WALL_M, rel=0.05)


@pytest.mark.parametrize("reset_deg", [0.0, 50.0])
def test_a_side_is_turned_with_the_vehicle_to_the_moment_of_the_main_picture(reset_deg: float) -> None:
    link = FakeLink(MonotonicClock())
    with looking(link, endless()) as (sides, perception):
        wait_until(lambda: sides.added_to(look(perception, link)).scan.state[RIGHT] == SectorState.OBSTACLE)
        main = look(perception, link)
        # 30 degrees to the right since: what was at 90 degrees is at 60.
        told = Attitude(0.0, 0.0, math.radians(30 + reset_deg))
        telemetry = replace(main.telemetry, attitude=told, heading_shift_rad=math.radians(reset_deg))
        turned = sides.added_to(replace(main, telemetry=telemetry))
    span = np.flatnonzero(turned.scan.state == SectorState.OBSTACLE)
    straight = np.flatnonzero(look(main_perception(), link).scan.state == SectorState.OBSTACLE)
    # The side's right edge, 40 degrees beyond its middle, moves from 130 to 100 degrees.
    assert span.max() <= straight.max() + 18 - 6 + 1
    assert turned.scan.state[RIGHT - 6] == SectorState.OBSTACLE


@pytest.mark.parametrize(
    ("changed", "state"),
    [
        ({"velocity_ned_mps": (0.1, 0.0, 0.0)}, SectorState.OBSTACLE),
        ({"position_ned_m": (3.0, 0.0, -FLYING_HEIGHT_M)}, SectorState.UNKNOWN),
        ({"epoch": 1}, SectorState.UNKNOWN),
    ],
)
def test_a_side_is_not_carried_over_a_jump_of_the_position(
    monkeypatch: pytest.MonkeyPatch, changed: dict[str, Any], state: SectorState
) -> None:
    link = FakeLink(MonotonicClock())
    standing = replace(link.telemetry_at(0), velocity_ned_mps=(0.0, 0.0, 0.0))
    monkeypatch.setattr(link, "telemetry_at", lambda at_ns: replace(standing, at_ns=at_ns))
    with looking(link, endless()) as (sides, perception):
        wait_until(lambda: sides.added_to(look(perception, link)).scan.state[RIGHT] == SectorState.OBSTACLE)
        main = look(perception, link)
        jumped = replace(main, telemetry=replace(main.telemetry, **changed))
        assert sides.added_to(jumped).scan.state[RIGHT] == state


def test_a_side_that_dies_in_flight_is_unknown_and_in_the_status() -> None:
    link = FakeLink(MonotonicClock())
    with looking(link, endless([picture()] * 20 + [CameraError("unplugged")])) as (sides, perception):

        def sends() -> int:
            result = sides.added_to(look(perception, link))
            assert result.trusted
            now_ns = link.clock.now_ns()
            sides.sent(now_ns)
            sides.judge(now_ns, is_sending=True)
            return int(result.scan.state[RIGHT])

        wait_until(lambda: sends() == SectorState.OBSTACLE)
        (side,) = sides.status(link.clock.now_ns())
        assert (side.name, side.used, side.trouble) == ("right", True, None)
        assert side.latency is not None
        assert side.age_s is not None
        assert side.frames_per_s > 0
        wait_until(lambda: sends() == SectorState.UNKNOWN and bool(link.said))
        assert link.said == [(SEVERITY_CRITICAL, "uavdepth: camera right OFF")]
        (side,) = sides.status(link.clock.now_ns())
        assert (side.used, side.trouble, side.losses) == (False, Trouble.CAMERA_LOST, 1)
        assert side.camera.detail


def test_what_seems_wrong_with_a_sides_mount_is_told_with_its_name(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Perception, "remark", lambda _self, _result: "uavdepth: mount pitch -21 roll 0")
    link = FakeLink(MonotonicClock())
    with looking(link, endless()):
        wait_until(lambda: bool(link.said))
    assert link.said[0] == (SEVERITY_WARNING, "uavdepth: mount pitch -21 roll 0 (right)")


class Bystander:
    """A side that is judged twenty times a second in a time of its own."""

    def __init__(self) -> None:
        self.now_ns = 0
        self.said: list[str] = []
        self.watch = SideWatch("right", 0, lambda _severity, text: self.said.append(text))
        self.camera = CameraStatus(CameraState.DELIVERING, "", 1, 0)

    def goes_on(
        self,
        seconds: float,
        trouble: Trouble | None = None,
        left_out: Trouble | None = None,
        *,
        is_sending: bool = False,
        delivers: bool = True,
    ) -> SideStatus:
        for _ in range(round(seconds * 20)):
            self.now_ns += 50_000_000
            if delivers:
                self.camera = replace(self.camera, newest_ns=self.now_ns)
                result = PerceptionResult(
                    Frame(picture(), self.now_ns, 0), Telemetry(0), None, None, unknown_scan(0.2, 20), trouble
                )
                self.watch.progress.measured(result, self.now_ns, self.now_ns)
            if is_sending and delivers and trouble is None and left_out is None:
                self.watch.progress.sent(self.now_ns, self.now_ns)
            self.watch.judge(self.now_ns, self.camera, left_out, is_sending=is_sending)
        return self.watch.status(self.now_ns, self.camera, 0)


def test_a_side_that_is_dead_before_take_off_is_told_on_the_ground() -> None:
    side = Bystander()
    side.camera = CameraStatus(CameraState.LOST, "no such device", 0, 0)
    assert side.goes_on(2.0, delivers=False).trouble is Trouble.CAMERA_LOST
    assert side.said == ["uavdepth: camera right OFF"]


def test_a_side_that_only_waits_for_take_off_as_all_do_is_not_told() -> None:
    side = Bystander()
    assert side.goes_on(5.0, Trouble.NO_POINTS).trouble is None
    assert side.goes_on(5.0).trouble is None  # it is ready, and the main camera is not
    assert side.said == []


@pytest.mark.parametrize(
    "missing", [{"trouble": Trouble.NO_POINTS}, {"left_out": Trouble.NO_POSITION}, {"delivers": False}]
)
def test_a_side_that_is_missing_from_what_is_sent_is_told_once_and_when_it_is_back(
    missing: dict[str, Any],
) -> None:
    side = Bystander()
    assert side.goes_on(2.0, is_sending=True).used
    assert side.goes_on(0.6, is_sending=True, **missing).losses == 0  # it may be a flicker
    missed = side.goes_on(5.0, is_sending=True, **missing)
    assert not missed.used
    assert missed.trouble is missing.get("trouble", missing.get("left_out", Trouble.CAMERA_LOST))
    assert missed.losses == 1
    assert side.goes_on(2.0, is_sending=True).used
    assert side.said == ["uavdepth: camera right OFF", "uavdepth: camera right ON"]


def test_a_side_that_failed_is_told_within_0_8_s_of_its_last_picture() -> None:
    side = Bystander()
    side.goes_on(2.0, is_sending=True)
    side.goes_on(0.8, is_sending=True, delivers=False)
    assert side.said == ["uavdepth: camera right OFF"]


def test_a_side_is_not_back_because_all_are_off() -> None:
    side = Bystander()
    side.goes_on(2.0, is_sending=True)
    side.goes_on(3.0, Trouble.NO_POINTS, is_sending=True)
    assert side.goes_on(3.0, Trouble.NO_POINTS).trouble is Trouble.NO_POINTS
    assert side.said == ["uavdepth: camera right OFF"]


def test_a_main_camera_in_trouble_silences_all() -> None:
    link = FakeLink(MonotonicClock())
    with looking(link, endless()) as (sides, perception):
        wait_until(lambda: sides.added_to(look(perception, link)).scan.state[RIGHT] == SectorState.OBSTACLE)
        blind = perception.step(Frame(picture(), link.clock.now_ns(), 0), Telemetry(0, None, FLYING_HEIGHT_M))
        assert blind.trouble is Trouble.NO_ATTITUDE
        assert sides.added_to(blind) is blind


def test_the_service_sends_and_records_what_all_cameras_see(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr("service.side_cameras.make_camera", lambda *_: endless())
    link = FakeLink(MonotonicClock())
    record = SETTINGS.record.model_copy(update={"enabled": True, "folder": str(tmp_path), "min_free_mib": 0})
    service = Service(
        SETTINGS.model_copy(update={"record": record}),
        link=link,
        camera=endless(),
        load_perception=lambda _settings: main_perception(),
    )
    service.start()
    try:
        wait_until(lambda: any(scan.state[RIGHT] == SectorState.OBSTACLE for scan, _ in link.sent[-5:]))
        wait_until(lambda: service.status().sides[0].used)
        sample = StatusSample.decode(status_sample(service.status()).encode())
        assert [(extra.name, extra.camera) for extra in sample.extra_cameras] == [("right", "delivering")]
        assert sample.extra_cameras[0].latency_ms_p95 is not None
        assert sample.cp_delay_s is not None
    finally:
        service.stop()
    scan = link.sent[-1][0]
    assert scan.state[AHEAD] == SectorState.OBSTACLE
    flight = open_flight([next(tmp_path.glob("*.mcap"))], None, [])
    assert flight.settings.extra_camera[0].mount.yaw_deg == 90.0
    pictures = list(flight.footage.pictures())
    assert {picture.camera for picture in pictures} == {"", "right"}
    assert all(picture.image_bgr is not None for picture in pictures)


@pytest.mark.parametrize(("armed", "stops"), [(False, True), (True, False)])
def test_a_side_of_another_size_stops_the_service_on_the_ground_and_never_in_the_air(
    monkeypatch: pytest.MonkeyPatch, armed: bool, stops: bool
) -> None:
    monkeypatch.setattr("service.side_cameras.make_camera", lambda *_: endless([PictureSizeError("64x48")]))
    link = FakeLink(MonotonicClock(), armed=armed)
    blind = ScriptedCamera(SETTINGS, link.clock, [])
    service = Service(SETTINGS, link=link, camera=blind, load_perception=lambda _settings: main_perception())
    service.start()
    try:
        wait_until(lambda: service.status().sides[0].camera.state is CameraState.FAILED)
        assert isinstance(service.failure, ConfigError) is stops
    finally:
        service.stop()


# -- the configuration


def test_cameras_are_listed_in_the_file(tmp_path: Path) -> None:
    path = tmp_path / "uavdepth.toml"
    path.write_text(
        '[camera]\nsource = "sim:wall"\n'
        '[[extra_camera]]\nname = "left"\n'
        'camera = { source = "1", horizontal_fov_deg = 70.0 }\nmount = { yaw_deg = -60.0 }\n'
        '[[extra_camera]]\nname = "right"\n'
        '[extra_camera.camera]\nsource = "2"\nhorizontal_fov_deg = 70.0\n'
        "[extra_camera.mount]\nyaw_deg = 60.0\n"
    )
    settings = load_settings(path, [])
    assert [extra.name for extra in settings.extra_camera] == ["left", "right"]
    assert settings.extra_camera[1].mount.mount.yaw_deg == 60.0
    assert "## [[extra_camera]]" in reference_markdown()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('name = "a"\ncamera = { source = "1", horizontal_fov_deg = 700.0 }', "camera horizontal_fov_deg"),
        ('name = "a"\ncamera = { source = "1" }', "no calibration"),
        ('name = "a"\ncamera = { sorce = "1" }', "did you mean source"),
        ('camera = { source = "1", horizontal_fov_deg = 70.0 }', "name: is missing"),
        (
            'name = "a"\ncamera = { source = "1", horizontal_fov_deg = 70.0 }\n[[extra_camera]]\nname = "a"\n'
            'camera = { source = "2", horizontal_fov_deg = 70.0 }',
            "have the name a",
        ),
    ],
)
def test_a_camera_that_is_wrong_is_named(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "uavdepth.toml"
    path.write_text(f'[camera]\nsource = "sim:wall"\n[[extra_camera]]\n{text}\n')
    with pytest.raises(ConfigError, match=words):
        load_settings(path, [])
