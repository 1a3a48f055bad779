"""One camera of several is lost: the vehicle is stopped on its way into what that one saw, and only there."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from program_fakes import FakeLink, ScriptedCamera, make_settings, picture, wait_until
from running_service import endless_camera, loader, network, texts

from service.autopilot.hold_request import HoldOutcome
from service.cameras.reader import CameraState
from service.clock import MonotonicClock
from service.errors import CameraError
from service.health import Vitals
from service.hold_keeper import HoldKeeper
from service.hold_on_loss import HoldOnLoss, Moment, Sight
from service.run import Service
from service.settings import Settings
from service.settings.extra_camera import ExtraCameraSettings
from service.side_watch import SideLoss
from service.telemetry import Telemetry
from service.trouble import Trouble
from uavdepth.attitude import Attitude
from uavdepth.camera import CameraModel, CameraMount

S = 1_000_000_000
RIGHT = Sight(math.radians(90.0), math.radians(45.0))


def lost_at_1_s(now_s: float, pose: Telemetry) -> Moment:
    """The camera's distances were sent last after 1 s; an armed ArduCopter in LOITER."""
    trouble = None if now_s <= 1.0 else Trouble.CAMERA_LOST
    sent_ns = min(round(now_s * S), S)
    return Moment(round(now_s * S), trouble, sent_ns, True, True, True, "ardupilot", "LOITER", pose)


def flying(at_s: float, velocity: tuple[float, float], yaw_deg: float | None) -> Telemetry:
    attitude = None if yaw_deg is None else Attitude(0.0, 0.0, math.radians(yaw_deg))
    place = (velocity[0] * at_s, velocity[1] * at_s, -5.0)
    return Telemetry(round(at_s * S), attitude, None, place, (*velocity, 0.0))


def asked(velocity: tuple[float, float], yaw_deg: float | None, seconds: float = 2.0) -> int:
    on_loss = HoldOnLoss(RIGHT)
    times = [0.05 * step for step in range(round(seconds / 0.05))]
    return sum(on_loss.hear(lost_at_1_s(at_s, flying(at_s, velocity, yaw_deg))) for at_s in times)


@pytest.mark.parametrize(
    ("velocity", "yaw_deg", "count"),
    [
        ((0.0, 2.0), 0.0, 1),  # east with the nose north: to the right
        ((2.0, 0.0), 0.0, 0),
        ((0.0, -2.0), 0.0, 0),
        ((2.0, 0.0), -90.0, 1),  # north with the nose west: to the right again
        ((0.0, 2.0), 90.0, 0),
        ((1.0, 1.9), 0.0, 1),
        ((2.0, 0.7), 0.0, 0),
        ((2.0, 0.0), None, 1),  # nobody knows where the nose points
    ],
)
def test_the_vehicle_is_stopped_on_its_way_into_what_is_not_seen_any_more(
    velocity: tuple[float, float], yaw_deg: float | None, count: int
) -> None:
    assert asked(velocity, yaw_deg) == count


@pytest.mark.parametrize(("velocity", "count"), [((0.0, 0.3), 1), ((0.3, 0.0), 0)])
def test_who_creeps_there_is_stopped_after_a_metre(velocity: tuple[float, float], count: int) -> None:
    assert asked(velocity, 0.0, seconds=6.0) == count


def test_a_way_elsewhere_does_not_use_up_the_request() -> None:
    on_loss = HoldOnLoss(RIGHT)
    ahead = [lost_at_1_s(at, flying(at, (2.0, 0.0), 0.0)) for at in (0.9, 1.0, 1.8, 2.5)]
    aside = lost_at_1_s(2.6, flying(2.6, (0.0, 2.0), 0.0))
    assert [on_loss.hear(moment) for moment in (*ahead, aside, aside)] == [False] * 4 + [True, False]


@pytest.mark.parametrize(("yaw_deg", "pitch_deg"), [(0.0, 0.0), (90.0, -20.0), (-120.0, 0.0), (180.0, 10.0)])
def test_a_cameras_sight_is_where_it_looks(yaw_deg: float, pitch_deg: float) -> None:
    camera = CameraModel.from_fov(64, 48, 80.0)
    sight = Sight.of(camera, CameraMount(yaw_deg=yaw_deg, pitch_deg=pitch_deg))
    assert math.degrees(math.remainder(sight.bearing_rad - math.radians(yaw_deg), math.tau)) == pytest.approx(
        0.0, abs=1.5
    )
    assert 38.0 < math.degrees(sight.half_width_rad) < 45.0


def test_after_a_landing_a_side_begins_anew() -> None:
    """On the ground all cameras are in trouble; what one flight has asked for must not count in the next."""
    link = FlyingLink(MonotonicClock(), mode="LOITER")
    keeper = HoldKeeper(link, {"right": RIGHT})
    link.velocity_ned_mps = (0.0, 2.0, 0.0)

    def hear(at_s: float, armed: bool, main: Trouble | None, side: Trouble | None, sent_s: float) -> bool:
        link.hold_outcome, link.armed = None, armed
        now_ns = round(at_s * S)
        vitals = Vitals(
            now_ns=now_ns,
            started_ns=0,
            camera=CameraState.DELIVERING,
            link_connected=True,
            armed=armed,
            frame_ns=now_ns,
            result_ns=now_ns,
            result_trouble=main,
            sent_ns=now_ns,
        )
        keeper.hear(vitals, main, link.status(), {"right": SideLoss(side, round(sent_s * S))})
        return link.hold_outcome is HoldOutcome.ASKED

    assert not hear(1.0, True, None, None, 1.0)
    assert hear(2.0, True, None, Trouble.CAMERA_LOST, 1.0)
    assert not hear(3.0, False, Trouble.ON_GROUND, Trouble.CAMERA_LOST, 1.0)
    assert not hear(10.0, True, None, None, 10.0)
    assert hear(11.0, True, None, Trouble.CAMERA_LOST, 10.0)


# -- in the service


class FlyingLink(FakeLink):
    """A link to a vehicle that moves."""

    velocity_ned_mps = (0.0, 0.0, 0.0)

    def telemetry_at(self, captured_ns: int) -> Telemetry:
        return replace(super().telemetry_at(captured_ns), velocity_ned_mps=self.velocity_ned_mps)


def with_a_right_camera() -> Settings:
    plain = make_settings("autopilot.on_loss=hold")
    mount = {"yaw_deg": 90.0}
    right = {"name": "right", "camera": plain.camera.model_dump(), "mount": mount}
    return plain.model_copy(update={"extra_camera": (ExtraCameraSettings.model_validate(right),)})


def test_a_side_camera_that_dies_stops_who_flies_to_that_side_and_nobody_else(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    settings, clock = with_a_right_camera(), MonotonicClock()
    side = ScriptedCamera(settings, clock, [picture()], forever=True)
    monkeypatch.setattr("service.side_cameras.make_camera", lambda *_: side)
    link = FlyingLink(clock, mode="LOITER")
    service = Service(
        settings, clock, link=link, camera=endless_camera(settings), load_perception=loader(network())
    )
    service.start()
    try:
        wait_until(lambda: service.status().sides[0].used)
        link.velocity_ned_mps = (2.0, 0.0, 0.0)
        side._acts = [CameraError("unplugged")]
        wait_until(lambda: "uavdepth: camera right OFF" in texts(link))
        sent = len(link.sent)
        wait_until(lambda: len(link.sent) > sent + 15)
        assert link.hold_outcome is None
        link.velocity_ned_mps = (0.0, 2.0, 0.0)
        wait_until(lambda: "uavdepth: asks for BRAKE" in texts(link))
        assert service.status().trouble is None
    finally:
        service.stop()
