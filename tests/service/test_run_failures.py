"""The service when something of it fails: it is told, counted and survived, or refused at the start."""

from __future__ import annotations

import threading

import numpy as np
import pytest
import zenoh
from numpy.typing import NDArray
from program_fakes import (
    FLYING_HEIGHT_M,
    FakeLink,
    ScriptedCamera,
    free_port,
    make_settings,
    picture,
    wait_until,
)
from running_service import SETTINGS, endless_camera, loader, network, running, texts

import service.publisher.publisher as publisher_module
from service.autopilot.link import AutopilotLink
from service.autopilot.service_state import ServiceState
from service.cameras.camera import PictureSizeError
from service.clock import MonotonicClock
from service.errors import CameraError, ConfigError, LinkError, PublisherError
from service.pipeline import Perception
from service.run import Service
from service.settings import Settings
from service.trouble import Trouble
from uavdepth.camera import CameraModel
from uavdepth.depth.depth_map import DepthMap


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
