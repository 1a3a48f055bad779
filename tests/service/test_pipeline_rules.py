"""What obstacle services are known to get wrong, held against the whole chain from picture to scan."""

from __future__ import annotations

import math
import threading
from dataclasses import dataclass, field

import numpy as np
import pytest
from numpy.typing import NDArray
from program_fakes import (
    FakeLink,
    FixedDepth,
    ScriptedCamera,
    make_settings,
    picture,
    wait_until,
    wall_over_ground,
)

from service.clock import MonotonicClock
from service.frame import Frame
from service.pipeline import Perception, make_scanner
from service.run import Service
from service.telemetry import Telemetry
from service.trouble import Trouble
from uavdepth.attitude import Attitude
from uavdepth.camera import CameraModel
from uavdepth.depth.depth_map import DepthMap
from uavdepth.model.hints import Hints
from uavdepth.scale.estimator import ScaleEstimator
from uavdepth.scan.body_rays import body_rays
from uavdepth.scan.obstacle_scan import ObstacleScan, SectorState

SETTINGS = make_settings("motion.points=false")
CAMERA, MOUNT = SETTINGS.camera.model, SETTINGS.mount.mount
RAYS = body_rays(CAMERA, MOUNT)
AHEAD = 31
LEVEL = Attitude(0.0, 0.0, 0.0)
FACTOR = 0.3
"""Metres that a network without hints makes one of its units of."""


def ground(attitude: Attitude, height_m: float) -> NDArray[np.float32]:
    """(H, W) z-depth of flat ground; the sky is as far as networks see."""
    down = np.tensordot(attitude.level_from_body[2], RAYS, axes=1)
    with np.errstate(divide="ignore"):
        return np.where(down > 1e-4, np.minimum(height_m / down, 1000.0), 1000.0).astype(np.float32)


def perception_of(model: FixedDepth, *, has_hints: bool) -> Perception:
    scale = None if has_hints else ScaleEstimator(CAMERA, MOUNT)
    return Perception(SETTINGS, model, scale, make_scanner(SETTINGS))


@pytest.mark.parametrize("has_hints", [True, False])
def test_r1_flat_ground_is_never_an_obstacle(has_hints: bool) -> None:
    rng = np.random.default_rng(1)
    measured = 0
    for number in range(100):
        height_m = float(np.exp(rng.uniform(0.0, math.log(30.0))))
        roll, pitch = np.radians(rng.uniform(-30, 30, 2))
        attitude = Attitude(float(roll), float(pitch), float(rng.uniform(-3, 3)))
        noise = np.exp(0.02 * rng.standard_normal((CAMERA.height, CAMERA.width)))
        depth = ground(attitude, height_m) * noise * (1.0 if has_hints else FACTOR)
        model = FixedDepth(depth.astype(np.float32), np.full(depth.shape, 0.03, np.float32))
        result = perception_of(model, has_hints=has_hints).step(
            Frame(picture(), number, number), Telemetry(number, attitude, height_m)
        )
        assert not np.any(result.scan.state == SectorState.OBSTACLE), (attitude, height_m)
        measured += result.scale is not None
    assert measured > 60


@pytest.mark.parametrize("has_hints", [True, False])
def test_r2_a_box_of_half_a_metre_is_not_taken_for_ground(has_hints: bool) -> None:
    settings = make_settings("motion.points=false", "camera.width=320", "camera.height=200")
    camera = settings.camera.model
    right, down = camera.normalized_rays[..., 0] * 5.0, camera.normalized_rays[..., 1] * 5.0
    depth = wall_over_ground(camera, 1000.0, 2.0)
    depth[(np.abs(right) <= 0.25) & (down >= 1.5) & (down <= 2.0)] = 5.0
    model = FixedDepth(depth * np.float32(1.0 if has_hints else FACTOR))
    scale = None if has_hints else ScaleEstimator(camera, MOUNT)
    perception = Perception(settings, model, scale, make_scanner(settings))
    frame = Frame(np.zeros((200, 320, 3), np.uint8), 0, 0)
    result = perception.step(frame, Telemetry(0, LEVEL, 2.0))
    assert result.scan.state[AHEAD] == SectorState.OBSTACLE
    assert 3.5 < result.scan.distance_m[AHEAD] < 5.2


@pytest.mark.parametrize(
    ("sigma", "state"),
    [(0.1, SectorState.CLEAR), (0.6, SectorState.UNKNOWN), (math.nan, SectorState.UNKNOWN)],
)
def test_r7_sky_is_clear_only_where_the_network_is_sure(sigma: float, state: SectorState) -> None:
    depth = ground(LEVEL, 2.0)
    doubt = np.full(depth.shape, 0.05, np.float32)
    doubt[depth > 100.0] = sigma
    result = perception_of(FixedDepth(depth, doubt), has_hints=True).step(
        Frame(picture(), 0, 0), Telemetry(0, LEVEL, 2.0)
    )
    assert result.scan.state[AHEAD] == state


def test_r11_a_full_turn_before_one_wall_leaves_no_ring() -> None:
    north_m = 8.0

    class Wall(FixedDepth):
        yaw = 0.0

        def infer(
            self, image_bgr: NDArray[np.uint8], camera: CameraModel, hints: Hints | None = None
        ) -> DepthMap:
            towards = np.tensordot(Attitude(0.0, 0.0, self.yaw).ned_from_body[0], RAYS, axes=1)
            with np.errstate(divide="ignore"):
                wall = np.where(towards > 1e-3, north_m / towards, 1000.0)
            return DepthMap(np.minimum(wall, ground(LEVEL, 2.0)).astype(np.float32))

    model = Wall(np.zeros((1, 1), np.float32))
    perception = perception_of(model, has_hints=True)
    for number in range(61):
        at_ns = number * 66_000_000
        model.yaw = math.remainder(math.radians(90.0) * at_ns * 1e-9, math.tau)
        telemetry = Telemetry(at_ns, Attitude(0.0, 0.0, model.yaw), 2.0, (0.0, 0.0, -2.0))
        scan = perception.step(Frame(picture(), at_ns, number), telemetry).scan
        seen = np.flatnonzero(scan.state == SectorState.OBSTACLE)
        bearings = np.radians(scan.bearing_deg[seen]) + model.yaw
        # Within 20 m the wall stands 66 degrees to either side of north; an element is 5 degrees wide.
        off = np.degrees(np.abs(np.arctan2(np.sin(bearings), np.cos(bearings))))
        assert np.all(off < 66.5 + 10.0)
        assert len(seen) <= 30


@dataclass
class TimedLink(FakeLink):
    """Notes how old each picture was when its scan was handed over."""

    ages_s: list[float] = field(default_factory=list)

    def send_obstacles(self, scan: ObstacleScan, captured_ns: int) -> bool:
        self.ages_s.append((self.clock.now_ns() - captured_ns) / 1e9)
        return super().send_obstacles(scan, captured_ns)


@dataclass
class Stalling(FixedDepth):
    """A network that never comes back from its tenth picture, until the test is over."""

    stalled: threading.Event = field(default_factory=threading.Event)
    over: threading.Event = field(default_factory=threading.Event)

    def infer(
        self, image_bgr: NDArray[np.uint8], camera: CameraModel, hints: Hints | None = None
    ) -> DepthMap:
        if self.asked >= 10:
            self.stalled.set()
            self.over.wait(20.0)
        return super().infer(image_bgr, camera)


def test_r8_after_the_network_has_stalled_nothing_goes_out_and_the_pilot_hears_of_it() -> None:
    clock = MonotonicClock()
    link = TimedLink(clock)
    model = Stalling(wall_over_ground(CAMERA, 8.0))
    service = Service(
        SETTINGS,
        link=link,
        camera=ScriptedCamera(SETTINGS, clock, [picture()], forever=True),
        load_perception=lambda _settings: perception_of(model, has_hints=False),
    )
    service.start()
    try:
        assert model.stalled.wait(20.0)
        sent = len(link.sent)
        wait_until(lambda: any(f"OFF: {Trouble.STALLED.value}" in text for _, text in link.said))
        assert len(link.sent) == sent
        model.over.set()
        wait_until(lambda: service.status().frames > 12)
        # The picture that was held up is too old by then.
        assert all(age_s <= SETTINGS.autopilot.max_frame_age_s + 0.3 for age_s in link.ages_s)
    finally:
        model.over.set()
        service.stop()
