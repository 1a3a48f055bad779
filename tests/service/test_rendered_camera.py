"""The rendered camera, with a vehicle that moves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from camera_files import MOUNT, shade_of
from program_fakes import FakeLink, make_settings

from service.cameras.camera import (
    CameraTimeoutError,
)
from service.cameras.rendered import RenderedCamera
from service.cameras.source import make_camera
from service.clock import ManualClock
from service.settings import Settings
from service.telemetry import Telemetry
from uavdepth.attitude import Attitude
from uavdepth.camera import CameraModel, CameraMount


class ForwardLink(FakeLink):
    """A vehicle that flies north by a metre a millisecond, beginning at one second."""

    def telemetry_at(self, captured_ns: int) -> Telemetry:
        return replace(
            super().telemetry_at(captured_ns), position_ned_m=(captured_ns / 1e6 - 1000.0, 0.0, -2.0)
        )


class PaintedScene:
    """A scene whose picture's shade is the vehicle's north coordinate."""

    def __init__(self, clock: ManualClock, takes_s: float = 0.0) -> None:
        self._clock, self._takes_s = clock, takes_s

    def render(
        self, camera: CameraModel, mount: CameraMount, position: Sequence[float], attitude: Attitude
    ) -> Any:
        self._clock.advance_s(self._takes_s)
        return SimpleNamespace(
            image_bgr=np.full((camera.height, camera.width, 3), int(position[0]), np.uint8)
        )


def rendered(clock: ManualClock, link: FakeLink, settings: Settings, takes_s: float = 0.0) -> RenderedCamera:
    camera = make_camera("sim:wall", settings.camera, clock, link, MOUNT)
    assert isinstance(camera, RenderedCamera)
    camera._scene = PaintedScene(clock, takes_s)  # type: ignore[assignment]
    camera.open()
    return camera


def test_the_rendered_picture_shows_the_pose_and_carries_its_time() -> None:
    clock = ManualClock(7_000_000_000)
    link = FakeLink(clock, position_ned_m=(42.0, 0.0, -2.0))
    frame = rendered(clock, link, make_settings()).read(1.0)
    assert shade_of(frame.image_bgr) == 42
    assert frame.captured_ns == 7_000_000_000


def test_a_picture_that_takes_time_to_render_shows_the_moment_at_which_it_is_ready() -> None:
    clock = ManualClock(1_000_000_000)
    link = ForwardLink(clock)
    camera = rendered(clock, link, make_settings(), takes_s=0.08)
    camera.read(1.0)
    clock.advance_s(0.02)
    frame = camera.read(1.0)
    assert frame.captured_ns == 1_180_000_000
    assert shade_of(frame.image_bgr) == 180
    assert clock.now_ns() == frame.captured_ns


class HeldUpLink(ForwardLink):
    """What was heard last is 0.3 s old: the computer was held up. Two milliseconds later comes the next."""

    def newest_pose(self) -> Telemetry:
        newest = self.telemetry_at(self.clock.now_ns() - 300_000_000)
        self.clock.advance_s(0.002)
        return newest


def test_an_old_pose_is_shown_as_it_was_and_not_carried_on() -> None:
    clock = ManualClock(1_000_000_000)
    link = ForwardLink(clock)
    camera = rendered(clock, link, make_settings(), takes_s=0.04)
    camera.read(1.0)
    clock.advance_s(0.4)
    camera._poses = HeldUpLink(clock)
    frame = camera.read(1.0)
    assert frame.captured_ns == 1_140_000_000
    assert shade_of(frame.image_bgr) == 140


def test_after_being_held_up_no_picture_is_older_than_the_one_before() -> None:
    clock = ManualClock(1_000_000_000)
    camera = rendered(clock, ForwardLink(clock), make_settings(), takes_s=0.08)
    camera.read(1.0)
    shown_ns = camera.read(1.0).captured_ns
    clock.advance_s(0.25)
    camera._poses = HeldUpLink(clock)
    assert camera._last_pose_ns < camera._poses.newest_pose().at_ns < shown_ns
    frame = camera.read(1.0)
    assert shown_ns < frame.captured_ns <= shown_ns + 2_000_000
    assert shade_of(frame.image_bgr) == (frame.captured_ns - 1_000_000_000) // 1_000_000


def test_without_a_pose_the_rendered_camera_says_what_it_waits_for() -> None:
    clock = ManualClock()
    for link in (FakeLink(clock, attitude=None), FakeLink(clock, position_ned_m=None)):
        with pytest.raises(CameraTimeoutError, match="waits for the autopilot's position and attitude"):
            rendered(clock, link, make_settings()).read(0.0)


def test_one_pose_makes_one_picture() -> None:
    clock = ManualClock(1)
    link = FakeLink(clock)
    camera = rendered(clock, link, make_settings("camera.fps=240"))
    camera.read(0.0)
    clock.advance_s(0.1)
    link.clock = ManualClock(1)  # the autopilot has sent nothing since
    with pytest.raises(CameraTimeoutError):
        camera.read(0.0)
    link.clock = clock
    assert camera.read(0.0).captured_ns == 100_000_001
