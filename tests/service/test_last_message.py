"""R8, R24: whatever dies, no old distance is sent; and no clock that people set is looked at."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import pytest
from numpy.typing import NDArray
from program_fakes import (
    FakeLink,
    ScriptedCamera,
    make_settings,
    picture,
    wait_until,
    wall_over_ground,
)

from service.autopilot.obstacle_gate import ObstacleGate
from service.autopilot.service_state import ServiceState
from service.cameras.camera import CameraTimeoutError
from service.clock import MonotonicClock
from service.errors import CameraError
from service.frame import Frame
from service.pipeline import Perception
from service.run import Service
from service.settings import Settings
from uavdepth.camera import CameraModel
from uavdepth.depth.depth_map import DepthMap
from uavdepth.errors import ModelFileError
from uavdepth.model.hints import Hints
from uavdepth.scan.obstacle_scan import ObstacleScan
from uavdepth.scan.scanner import ObstacleScanner

SETTINGS = make_settings()
DEADLINE_NS = 300_000_000
"""Oldest picture that is sent ([autopilot] max_frame_age_s)."""


@dataclass
class StampingLink(FakeLink):
    """Has the gate of the real link, and notes what passed it and when."""

    handed: list[tuple[int, int]] = field(default_factory=list)
    gate: ObstacleGate = field(default_factory=lambda: ObstacleGate(30.0, DEADLINE_NS))

    def send_obstacles(self, scan: ObstacleScan, captured_ns: int) -> bool:
        now_ns = self.clock.now_ns()
        if self.gate.refusal(captured_ns, now_ns) is not None:
            return False
        self.gate.passed(captured_ns, now_ns)
        self.handed.append((captured_ns, now_ns))
        return super().send_obstacles(scan, captured_ns)


class LivingCamera(ScriptedCamera):
    """A camera with noise, until it freezes, hangs or is pulled out."""

    has_noise = True

    def __init__(self, settings: Settings) -> None:
        super().__init__(settings, MonotonicClock(), [])
        self.fate: Callable[[], Frame] | None = None
        self._count = 0
        self.newest: NDArray[np.uint8] = picture()

    def read(self, timeout_s: float) -> Frame:
        self._wait(0.01)
        if self.fate is not None:
            return self.fate()
        self._count += 1
        self.newest = picture(self._count % 250)
        return self._frame(self.newest, self.clock.now_ns())

    def freeze(self) -> None:
        """The same picture again, with a new stamp each time."""
        self.fate = lambda: self._frame(self.newest, self.clock.now_ns())

    def hang(self) -> None:
        self.fate = lambda: self._raise(CameraTimeoutError("nothing comes"))

    def pull_out(self) -> None:
        self.fate = lambda: self._raise(CameraError("unplugged"))

    @staticmethod
    def _raise(error: Exception) -> Frame:
        raise error


class LivingNetwork:
    """Sees a wall, until it hangs or fails."""

    def __init__(self) -> None:
        self.hangs = threading.Event()
        self.goes_on = threading.Event()
        self.fails = False

    def infer(
        self, image_bgr: NDArray[np.uint8], camera: CameraModel, hints: Hints | None = None
    ) -> DepthMap:
        if self.hangs.is_set():
            self.goes_on.wait()
        if self.fails:
            raise ModelFileError("the network is dead")
        return DepthMap(wall_over_ground(camera, 8.0), None)


@pytest.mark.parametrize(
    "what_dies",
    ["camera frozen", "camera hangs", "camera pulled out", "inference stalled", "network dead"],
)
def test_r8_the_last_message_is_of_a_good_frame_within_its_deadline(what_dies: str) -> None:
    camera, network = LivingCamera(SETTINGS), LivingNetwork()
    link = StampingLink(MonotonicClock())

    def load(settings: Settings) -> Perception:
        scanner = ObstacleScanner(settings.camera.model, settings.mount.mount, sigma_factor=0.0)
        return Perception(settings, network, None, scanner, takes=("ground",))

    service = Service(SETTINGS, link=link, camera=camera, load_perception=load)
    service.start()
    try:
        wait_until(lambda: link.states[-1:] == [ServiceState.ACTIVE])
        died_ns = link.clock.now_ns()
        if what_dies == "inference stalled":
            network.hangs.set()
        elif what_dies == "network dead":
            network.fails = True
        else:
            {"frozen": camera.freeze, "hangs": camera.hang, "out": camera.pull_out}[what_dies.split()[-1]]()
        wait_until(lambda: link.states[-1] is ServiceState.CRITICAL)
        count = len(link.handed)
        network.goes_on.set()
        wait_until(lambda: link.clock.now_ns() > died_ns + 4 * DEADLINE_NS)
        if what_dies != "inference stalled":  # it goes on, and so may the messages: of new pictures
            assert len(link.handed) == count
        assert all(at_ns - captured_ns <= DEADLINE_NS for captured_ns, at_ns in link.handed)
        captures = [captured_ns for captured_ns, _ in link.handed]
        assert captures == sorted(set(captures)), "no picture is sent twice"
    finally:
        network.goes_on.set()
        service.stop()


def test_r24_the_live_clock_is_the_monotonic_one(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(time, "time", lambda: 0.0)
    monkeypatch.setattr(time, "time_ns", lambda: 0)
    before = time.monotonic_ns()
    now = MonotonicClock().now_ns()
    assert before <= now <= time.monotonic_ns()
