"""The mount is held against the ground in flight, now and then, and told once where it seems wrong."""

from __future__ import annotations

import math

import numpy as np
import pytest
from program_fakes import make_settings, picture
from structlog.testing import capture_logs

from service.frame import Frame
from service.mount_watch import MountWatch
from service.settings import Settings
from service.telemetry import Telemetry
from uavdepth.attitude import Attitude
from uavdepth.camera import CameraMount
from uavdepth.depth.depth_map import DepthMap
from uavdepth.mount_check import MountState

SETTINGS = make_settings("mount.pitch_deg=-15", "mount.check_every_s=2")
CAMERA = SETTINGS.camera.model


class Sky:
    """A turn on the spot above level ground by a vehicle whose camera really sits at `true`."""

    def __init__(self, true: CameraMount, settings: Settings = SETTINGS) -> None:
        self.true = true
        self.asked = 0
        self.error: Exception | None = None
        self.watch = MountWatch(settings, self.infer)

    def attitude(self, seconds: float) -> Attitude:
        return Attitude(0.03 * math.sin(seconds), 0.03 * math.cos(2 * seconds), 0.15 * seconds)

    def infer(self, frame: Frame) -> DepthMap:
        self.asked += 1
        if self.error is not None:
            raise self.error
        turn = self.attitude(frame.captured_ns * 1e-9).ned_from_body @ self.true.body_from_camera
        towards = CAMERA.normalized_rays.astype(np.float64) @ turn.T[:, 2]
        with np.errstate(divide="ignore"):
            return DepthMap(np.where(towards > 1e-3, 2.0 / towards, np.inf).astype(np.float32))

    def fly(self, until_s: float, armed: bool | None = True) -> list[str]:
        said = []
        for number in range(round(until_s * 2)):
            at_ns = number * 500_000_000
            telemetry = Telemetry(at_ns, self.attitude(at_ns * 1e-9), 5.0, armed=armed)
            text = self.watch.look(Frame(picture(), at_ns, number), telemetry)
            if text is not None:
                said.append(text)
        return said


def test_a_camera_that_looks_lower_than_configured_is_told_once() -> None:
    sky = Sky(CameraMount(pitch_deg=-21.0))
    with capture_logs() as log:
        said = sky.fly(90.0)
    assert said == ["uavdepth: mount pitch -21 roll 0 by ground"]
    assert len(said[0]) <= 50
    assert [entry["log_level"] for entry in log] == ["warning"]
    assert sky.watch.verdict is not None
    assert sky.watch.verdict.state is MountState.DIFFERS
    assert sky.watch.verdict.pitch_deg == pytest.approx(-21.0, abs=0.5)


def test_a_camera_to_the_side_is_judged_as_well() -> None:
    settings = make_settings("mount.pitch_deg=-15", "mount.yaw_deg=90", "mount.check_every_s=2")
    said = Sky(CameraMount(pitch_deg=-21.0, yaw_deg=90.0), settings).fly(90.0)
    assert said == ["uavdepth: mount pitch -21 roll 0 by ground"]
    assert Sky(CameraMount(pitch_deg=-15.0, yaw_deg=90.0), settings).fly(90.0) == []


def test_a_camera_as_configured_is_no_news_for_the_pilot() -> None:
    sky = Sky(CameraMount(pitch_deg=-15.5))
    assert sky.fly(90.0) == []
    assert sky.watch.verdict is not None
    assert sky.watch.verdict.state is MountState.AGREES


def test_one_picture_in_a_while_is_looked_at() -> None:
    sky = Sky(CameraMount(pitch_deg=-15.0))
    sky.fly(20.0)
    assert sky.asked == 10


@pytest.mark.parametrize("armed", [False, None])
def test_a_vehicle_that_is_not_in_the_air_is_not_judged(armed: bool | None) -> None:
    sky = Sky(CameraMount(pitch_deg=-21.0))
    assert sky.fly(60.0, armed) == []
    assert sky.asked == 0


def test_a_failure_ends_the_check_and_nothing_else() -> None:
    sky = Sky(CameraMount(pitch_deg=-21.0))
    sky.error = RuntimeError("provider broke")
    with capture_logs() as log:
        assert sky.fly(60.0) == []
    assert sky.asked == 1
    assert len(log) == 1
