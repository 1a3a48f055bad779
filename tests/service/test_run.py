"""The service as a whole: what reaches the autopilot, when it is silent, and what it says of itself."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
import zenoh
from numpy.typing import NDArray
from program_fakes import (
    FLYING_HEIGHT_M,
    FakeLink,
    FixedDepth,
    ScriptedCamera,
    free_port,
    make_settings,
    picture,
    wait_until,
    wall_over_ground,
)

import service.publisher.publisher as publisher_module
from service.autopilot.link import AutopilotLink
from service.autopilot.service_state import ServiceState
from service.cameras.camera import PictureSizeError
from service.clock import MonotonicClock
from service.errors import CameraError, ConfigError, LinkError, PublisherError
from service.fake_autopilot.fake_autopilot import FakeAutopilot
from service.fake_autopilot.pilot import Pilot
from service.pipeline import Perception
from service.run import Service
from service.settings import Settings
from service.trouble import Trouble
from uavdepth.camera import CameraModel
from uavdepth.depth_map import DepthMap
from uavdepth.obstacle_scan import SectorState
from uavdepth.scale_estimator import ScaleEstimator
from uavdepth.scanner import ObstacleScanner

SETTINGS = make_settings()
WALL_M = 8.0
AHEAD = 31
PARAMETERS = {"ardupilot": {"PRX_FILT": 0.0}, "px4": {"CP_DIST": 3.0}}
"""What makes each autopilot listen to distances at once."""


def network(scale: float = 0.25) -> FixedDepth:
    """Sees a wall at 8 m, in units of its own."""
    return FixedDepth(wall_over_ground(SETTINGS.camera.model, WALL_M) * np.float32(scale))


def loader(model: Any) -> Callable[[Settings], Perception]:
    def load(settings: Settings) -> Perception:
        camera, mount = settings.camera.model, settings.mount.mount
        scanner = ObstacleScanner(camera, mount, sigma_factor=0.0)
        return Perception(settings, model, ScaleEstimator(camera, mount), scanner)

    return load


def endless_camera(settings: Settings = SETTINGS, age_ns: int = 0) -> ScriptedCamera:
    return ScriptedCamera(settings, MonotonicClock(), [picture()], forever=True, age_ns=age_ns)


@dataclass
class Running:
    service: Service
    link: FakeLink


@contextmanager
def running(
    model: Any = None,
    camera: ScriptedCamera | None = None,
    settings: Settings = SETTINGS,
    **link_values: Any,
) -> Iterator[Running]:
    clock = MonotonicClock()
    link = FakeLink(clock, **link_values)
    service = Service(
        settings,
        clock,
        link=link,
        camera=camera or endless_camera(settings),
        load_perception=loader(model or network()),
    )
    service.start()
    try:
        yield Running(service, link)
    finally:
        service.stop()


def texts(link: FakeLink) -> list[str]:
    return [text for _, text in link.said]


def test_a_wall_reaches_the_autopilot_in_metres_and_the_pilot_reads_that_obstacles_are_on() -> None:
    with running() as run:
        wait_until(lambda: len(run.link.sent) >= 3)
        scan, _ = run.link.sent[-1]
        assert scan.state[AHEAD] == SectorState.OBSTACLE
        assert scan.distance_m[AHEAD] == pytest.approx(WALL_M, rel=0.05)
        wait_until(lambda: "uavdepth: obstacles ON" in texts(run.link))
        wait_until(lambda: run.link.states[-1] is ServiceState.ACTIVE)
    assert run.link.closed
    assert texts(run.link)[-1] == "uavdepth OFF: stopped"


def test_every_message_comes_from_a_frame_of_its_own() -> None:
    with running() as run:
        wait_until(lambda: len(run.link.sent) >= 10)
        stamps = [captured_ns for _, captured_ns in run.link.sent]
        assert stamps == sorted(set(stamps))


@pytest.mark.parametrize(
    ("link_values", "trouble"),
    [
        ({"attitude": None}, Trouble.NO_ATTITUDE),
        ({"height_m": None}, Trouble.NO_HEIGHT),
        ({"height_m": 0.1}, Trouble.NO_GROUND),
    ],
)
def test_without_what_metres_need_nothing_is_sent_and_the_pilot_reads_why(
    link_values: dict[str, Any], trouble: Trouble
) -> None:
    with running(**link_values) as run:
        wait_until(lambda: f"uavdepth OFF: {trouble.value}" in texts(run.link))
        assert run.link.sent == []
        assert run.link.states[-1] is ServiceState.STANDBY
        assert run.service.status().trouble is trouble


def test_on_the_ground_the_autopilot_hears_that_the_sensor_lives_and_no_distance() -> None:
    """Without any message ArduPilot refuses to arm: "PRX1: No Data"."""
    with running(height_m=None, armed=False) as run:
        wait_until(lambda: len(run.link.sent) >= 3)
        assert all(np.all(scan.state == SectorState.UNKNOWN) for scan, _ in run.link.sent)
        wait_until(lambda: "uavdepth ready: distances after take-off" in texts(run.link))
        assert run.link.states[-1] is ServiceState.STANDBY
        assert run.service.status().obstacle_messages == 0


def test_a_vehicle_that_has_its_height_from_the_ekf_can_be_armed_too() -> None:
    settings = make_settings("scale.height_source=both")
    on_ground: dict[str, Any] = {"height_m": None, "position_ned_m": (0.0, 0.0, 0.0), "rangefinder_hz": 0.0}
    with running(settings=settings, armed=False, **on_ground) as run:
        wait_until(lambda: len(run.link.sent) >= 3)
        assert all(np.all(scan.state == SectorState.UNKNOWN) for scan, _ in run.link.sent)


@pytest.mark.parametrize(
    "link_values", [{"armed": True}, {"armed": None}, {"armed": False, "rangefinder_hz": 0.0}]
)
def test_in_the_air_or_without_rangefinder_a_lack_of_height_is_silence(link_values: dict[str, Any]) -> None:
    with running(height_m=None, **link_values) as run:
        wait_until(lambda: "uavdepth OFF: no height above ground" in texts(run.link))
        assert run.link.sent == []


def test_losing_the_height_in_the_air_is_critical_and_its_return_is_told() -> None:
    settings = make_settings("scale.max_age_s=0")
    with running(settings=settings) as run:
        wait_until(lambda: run.link.states[-1:] == [ServiceState.ACTIVE])
        run.link.height_m = None
        wait_until(lambda: run.link.states[-1] is ServiceState.CRITICAL)
        wait_until(lambda: "uavdepth OFF: no height above ground" in texts(run.link))
        run.link.height_m = FLYING_HEIGHT_M
        wait_until(lambda: run.link.states[-1] is ServiceState.ACTIVE)
        wait_until(lambda: texts(run.link)[-1] == "uavdepth: obstacles ON")


def test_a_camera_that_dies_is_critical_and_no_frame_is_sent_again() -> None:
    camera = ScriptedCamera(SETTINGS, MonotonicClock(), [picture()] * 30 + [CameraError("unplugged")])
    with running(camera=camera) as run:
        wait_until(lambda: ServiceState.ACTIVE in run.link.states)
        wait_until(lambda: run.link.states[-1] is ServiceState.CRITICAL)
        count = len(run.link.sent)
        wait_until(lambda: "uavdepth OFF: no pictures from the camera" in texts(run.link))
        assert len(run.link.sent) == count <= 30
        assert run.service.failure is None


def test_pictures_that_are_too_old_are_never_sent() -> None:
    with running(camera=endless_camera(age_ns=400_000_000)) as run:
        wait_until(lambda: f"uavdepth OFF: {Trouble.STALE_FRAME.value}" in texts(run.link))
        assert run.link.sent == []
        result = run.service.last_result
        assert result is not None
        assert np.all(result.scan.state == SectorState.UNKNOWN)


class StallingNetwork:
    """A network that answers until it is told to hang."""

    def __init__(self) -> None:
        self.hang = False
        self.release = threading.Event()
        self._inner = network()

    def infer(self, image_bgr: NDArray[np.uint8], camera: CameraModel) -> DepthMap:
        if self.hang:
            self.release.wait()
        return self._inner.infer(image_bgr, camera)


def test_a_network_that_hangs_is_told_though_its_thread_cannot_speak() -> None:
    model = StallingNetwork()
    with running(model=model) as run:
        wait_until(lambda: ServiceState.ACTIVE in run.link.states)
        model.hang = True
        wait_until(lambda: run.link.states[-1] is ServiceState.CRITICAL)
        wait_until(lambda: f"uavdepth OFF: {Trouble.STALLED.value}" in texts(run.link))
        wait_until(lambda: run.service.status().drops.frames > 0)
        model.hang = False
        model.release.set()
        wait_until(lambda: run.link.states[-1] is ServiceState.ACTIVE)


def test_a_network_that_fails_is_counted_and_told() -> None:
    model = network()
    model.error = RuntimeError("provider broke")
    with running(model=model) as run:
        wait_until(lambda: f"uavdepth OFF: {Trouble.MODEL_FAILED.value}" in texts(run.link))
        assert run.service.status().model_failures > 0
        assert run.link.states[-1] is ServiceState.CRITICAL
        model.error = None
        wait_until(lambda: run.link.states[-1] is ServiceState.ACTIVE)


def test_a_link_that_takes_nothing_is_not_called_active() -> None:
    with running(takes_obstacles=False) as run:
        wait_until(lambda: f"uavdepth OFF: {Trouble.NOT_SENT.value}" in texts(run.link))
        assert ServiceState.ACTIVE not in run.link.states
        assert run.service.status().obstacle_messages == 0
        assert run.service.status().latency is None


def test_an_autopilot_that_never_speaks_leaves_the_service_starting_and_alive() -> None:
    with running(connected=False, takes_obstacles=False) as run:
        wait_until(lambda: run.service.status().frames > 3)
        assert run.service.status().state is ServiceState.BOOT
        assert run.service.failure is None
        run.link.connected = run.link.takes_obstacles = True
        wait_until(lambda: run.link.states[-1] is ServiceState.ACTIVE)


@pytest.mark.parametrize("how", ["hangs", "raises"])
def test_the_autopilot_waits_for_no_ground_station(how: str, monkeypatch: pytest.MonkeyPatch) -> None:
    release = threading.Event()

    def stalled(*_: object) -> zenoh.Session:
        if how == "hangs":
            release.wait()
        raise ZeroDivisionError("zenoh is broken")

    monkeypatch.setattr(publisher_module, "open_session", stalled)
    settings = make_settings("zenoh.enabled=true", f"zenoh.listen=['tcp/127.0.0.1:{free_port()}']")
    with running(settings=settings) as run:
        wait_until(lambda: len(run.link.sent) >= 10)
        wait_until(lambda: run.link.states[-1] is ServiceState.ACTIVE)
        release.set()
        wait_until(lambda: "ZeroDivisionError" in _publisher_detail(run.service))


def _publisher_detail(service: Service) -> str:
    status = service.status().publisher
    return "" if status is None else status.detail


def test_a_subscriber_that_takes_nothing_delays_nobody() -> None:
    with running() as run:
        slow, keen = run.service.subscribe(), run.service.subscribe()
        wait_until(lambda: keen.take() is not None)
        count = len(run.link.sent)
        wait_until(lambda: len(run.link.sent) > count + 5)
        assert slow.dropped_count > 0
        result = slow.take()
        assert result is not None
        assert result.frame.image_bgr.shape == picture().shape
        assert result.depth is not None
        slow.close()
    assert keen.closed


def test_status_tells_what_the_issue_of_the_day_needs() -> None:
    with running() as run:
        wait_until(lambda: run.service.status().obstacle_messages >= 5)
        status = run.service.status()
        assert status.frames >= status.obstacle_messages
        assert status.frames_per_s > 0
        assert status.latency is not None
        assert 0 <= status.latency.p50_ms <= status.latency.p95_ms
        assert status.scale is not None
        assert status.scale.factor == pytest.approx(4.0, rel=0.03)
        assert status.step_ms is not None
        assert status.step_ms > 0
        assert status.memory_mib > 10
        assert status.height_m == FLYING_HEIGHT_M
        assert status.armed is True
        assert status.link.connected
        assert status.camera.frames >= status.frames
        assert status.publisher is None


def test_a_network_that_cannot_be_loaded_stops_the_start_and_leaves_nothing_open() -> None:
    clock = MonotonicClock()
    link, camera = FakeLink(clock), endless_camera()

    def refuse(settings: Settings) -> Perception:
        raise ConfigError("[model] path: no such file")

    service = Service(SETTINGS, clock, link=link, camera=camera, load_perception=refuse)
    with pytest.raises(ConfigError, match=r"\[model\] path"):
        service.start()
    assert link.closed
    assert camera.close_count >= 1
    service.stop()


def test_a_port_that_another_program_listens_on_is_named() -> None:
    first = Service(
        make_settings("autopilot.endpoint=udp:127.0.0.1:0"),
        camera=endless_camera(),
        load_perception=loader(network()),
    )
    first.start()
    try:
        link = first._link
        assert isinstance(link, AutopilotLink)
        second = Service(
            make_settings(f"autopilot.endpoint=udp:127.0.0.1:{link.listen_port}"),
            camera=endless_camera(),
            load_perception=loader(network()),
        )
        with pytest.raises(LinkError, match=f"127.0.0.1:{link.listen_port}"):
            second.start()
    finally:
        first.stop()


def test_pictures_of_the_wrong_size_end_the_service_with_the_key() -> None:
    camera = ScriptedCamera(SETTINGS, MonotonicClock(), [PictureSizeError("[camera] width, height: no")])
    with running(camera=camera) as run:
        wait_until(lambda: run.service.failure is not None)
        assert isinstance(run.service.failure, ConfigError)
        assert run.link.sent == []


def test_a_zenoh_port_in_use_does_not_touch_the_autopilot(monkeypatch: pytest.MonkeyPatch) -> None:
    def in_use(*_: object) -> zenoh.Session:
        raise PublisherError("zenoh: tcp/127.0.0.1:7447 is in use by another program")

    monkeypatch.setattr(publisher_module, "open_session", in_use)
    with running(settings=make_settings("zenoh.enabled=true")) as run:
        wait_until(lambda: "in use" in _publisher_detail(run.service))
        wait_until(lambda: len(run.link.sent) >= 3)


@pytest.mark.parametrize("flavor", ["ardupilot", "px4"])
def test_a_flying_vehicle_hears_where_the_wall_is(flavor: Any) -> None:
    """Real MAVLink over TCP and real Zenoh; only the camera and the network are stand-ins."""
    port = free_port()
    with FakeAutopilot(flavor, "tcp:127.0.0.1:0", parameters=PARAMETERS[flavor]) as autopilot:
        settings = make_settings(
            f"autopilot.endpoint={autopilot.address}",
            "zenoh.enabled=true",
            f"zenoh.listen=['tcp/127.0.0.1:{port}']",
        )
        service = Service(settings, camera=endless_camera(settings), load_perception=loader(network()))
        service.start()
        try:
            wait_until(lambda: service.status().link.connected)
            with Pilot(autopilot.address) as pilot:
                pilot.take_off(FLYING_HEIGHT_M)
                pilot.fly_forward(0.0)
                wait_until(lambda: service.status().state is ServiceState.ACTIVE)
                wait_until(lambda: autopilot.truth().obstacle_messages > 15)

                def settled() -> bool:
                    # The network's picture never changes: the metres in it follow the height alone.
                    nearest, height = autopilot.truth().nearest_m, service.status().height_m
                    wall_m = WALL_M * (height or 0.0) / FLYING_HEIGHT_M
                    return nearest is not None and abs(nearest - wall_m) < 0.6

                wait_until(settled)
                status = service.status()
                assert status.link.autopilot == flavor
                assert status.link.system_id == 1
                assert status.latency is not None
        finally:
            service.stop()
