"""The service as a whole: what reaches the autopilot, when it is silent, and what it says of itself."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from program_fakes import (
    FLYING_HEIGHT_M,
    free_port,
    make_settings,
    picture,
    wait_until,
)
from running_service import WALL_M, endless_camera, loader, network, running, texts

from service.autopilot.service_state import ServiceState
from service.fake_autopilot.fake_autopilot import FakeAutopilot
from service.fake_autopilot.pilot import Pilot
from service.run import Service
from service.trouble import Trouble
from uavdepth.scan.obstacle_scan import SectorState

AHEAD = 31


PARAMETERS = {"ardupilot": {"PRX_FILT": 0.0}, "px4": {"CP_DIST": 3.0}}
"""What makes each autopilot listen to distances at once."""


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


def test_pictures_that_are_too_old_are_never_sent() -> None:
    with running(camera=endless_camera(age_ns=400_000_000)) as run:
        wait_until(lambda: f"uavdepth OFF: {Trouble.STALE_FRAME.value}" in texts(run.link))
        assert run.link.sent == []
        result = run.service.last_result
        assert result is not None
        assert np.all(result.scan.state == SectorState.UNKNOWN)


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
