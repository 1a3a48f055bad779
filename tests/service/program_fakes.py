"""Stand-ins for the parts around the service: each does one thing that a test can foresee."""

from __future__ import annotations

import math
import os
import socket
import threading
import time
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import count

import numpy as np
from numpy.typing import NDArray

from service.autopilot.hold_request import HoldOutcome
from service.autopilot.link_status import LinkStatus
from service.autopilot.service_state import ServiceState
from service.cameras.camera import Camera, CameraTimeoutError
from service.clock import Clock
from service.frame import Frame
from service.settings import Settings
from service.settings.load import load_settings
from service.telemetry import Telemetry
from uavdepth.attitude import Attitude
from uavdepth.camera import CameraModel
from uavdepth.depth.depth_map import DepthMap
from uavdepth.model.hints import Hints
from uavdepth.scan.obstacle_scan import ObstacleScan

WIDTH, HEIGHT = 160, 96
LEVEL = Attitude(0.0, 0.0, 0.0)
FLYING_HEIGHT_M = 2.0
WAIT_S = 20.0
"""Far longer than anything takes: a test that reaches it has failed."""

_PORTS = (20_000 + (509 * os.getpid() + number) % 12_000 for number in count())
"""Below those that systems hand out by themselves; of each process of tests its own few hundred."""


def make_settings(*overrides: str) -> Settings:
    """Small pictures, no Zenoh, height by the rangefinder alone, the rest at its default."""
    return load_settings(
        None,
        [
            "camera.source=sim:wall",
            f"camera.width={WIDTH}",
            f"camera.height={HEIGHT}",
            "camera.horizontal_fov_deg=80",
            "camera.reopen_after_s=0.05",
            "zenoh.enabled=false",
            "scale.height_source=rangefinder",
            *overrides,
        ],
    )


def wait_until(holds: Callable[[], bool]) -> None:
    """Return as soon as `holds`; the test fails if it never does."""
    end = time.monotonic() + WAIT_S
    pause = threading.Event()
    while not holds():
        if time.monotonic() > end:
            raise AssertionError(f"still not so after {WAIT_S} s")
        pause.wait(0.005)


def free_port() -> int:
    """A TCP port of the loopback that nobody uses now, nor takes before it is used."""
    while True:
        port = next(_PORTS)
        with socket.socket() as probe, suppress(OSError):
            probe.bind(("127.0.0.1", port))
            return port


def wall_over_ground(
    camera: CameraModel, wall_m: float, height_m: float = FLYING_HEIGHT_M
) -> NDArray[np.float32]:
    """(H, W) z-depth of a wall straight ahead on flat ground, seen level from `height_m`."""
    down = camera.normalized_rays[..., 1]
    with np.errstate(divide="ignore"):
        ground = np.where(down > 0, height_m / down, np.inf)
    return np.minimum(ground, wall_m).astype(np.float32)


def picture(value: int = 0) -> NDArray[np.uint8]:
    """A picture of the tests' size in one shade."""
    return np.full((HEIGHT, WIDTH, 3), value, np.uint8)


@dataclass
class FixedDepth:
    """A network that answers every picture with the same depth, or fails with the same error."""

    depth_m: NDArray[np.float32]
    relative_sigma: NDArray[np.float32] | None = None
    error: Exception | None = None
    asked: int = 0

    def infer(
        self, image_bgr: NDArray[np.uint8], camera: CameraModel, hints: Hints | None = None
    ) -> DepthMap:
        self.asked += 1
        if self.error is not None:
            raise self.error
        return DepthMap(self.depth_m, self.relative_sigma)


@dataclass
class FakeLink:
    """An autopilot link that remembers what it was told."""

    clock: Clock
    connected: bool = True
    armed: bool | None = True
    attitude: Attitude | None = LEVEL
    height_m: float | None = FLYING_HEIGHT_M
    position_ned_m: tuple[float, float, float] | None = (0.0, 0.0, -FLYING_HEIGHT_M)
    rangefinder_hz: float = 20.0
    takes_obstacles: bool = True
    sent: list[tuple[ObstacleScan, int]] = field(default_factory=list)
    states: list[ServiceState] = field(default_factory=list)
    said: list[tuple[int, str]] = field(default_factory=list)
    closed: bool = False
    mode: str | None = None
    hold_outcome: HoldOutcome | None = None

    def start(self) -> None:
        return

    def telemetry_at(self, captured_ns: int) -> Telemetry:
        return Telemetry(captured_ns, self.attitude, self.height_m, self.position_ned_m, armed=self.armed)

    def newest_pose(self) -> Telemetry:
        return self.telemetry_at(self.clock.now_ns())

    def predicted_pose(self, at_ns: int) -> Telemetry:
        return self.telemetry_at(at_ns)

    def send_obstacles(self, scan: ObstacleScan, captured_ns: int) -> bool:
        if self.takes_obstacles:
            self.sent.append((scan, captured_ns))
        return self.takes_obstacles

    def set_state(self, state: ServiceState) -> None:
        if not self.states or self.states[-1] is not state:
            self.states.append(state)

    def say(self, severity: int, text: str) -> None:
        self.said.append((severity, text))

    def hold(self) -> str:
        self.hold_outcome = HoldOutcome.ASKED
        return "BRAKE"

    def status(self) -> LinkStatus:
        return LinkStatus(
            "fake:",
            connected=self.connected,
            armed=self.armed,
            system_id=1,
            rates_hz={"DISTANCE_SENSOR": self.rangefinder_hz},
            autopilot="ardupilot",
            mode=self.mode,
            hold=self.hold_outcome,
            sent_obstacles=len(self.sent),
        )

    def close(self) -> None:
        self.closed = True


Act = NDArray[np.uint8] | Exception


class ScriptedCamera(Camera):
    """A camera that plays a script: pictures are delivered, errors raised; then it delivers nothing.

    Args:
        acts: what `read` does, call by call.
        opens: what `open` does, call by call: an error to raise, or None; then it works.
        forever: repeat the last act instead of delivering nothing.
    """

    def __init__(
        self,
        settings: Settings,
        clock: Clock,
        acts: Iterable[Act],
        opens: Iterable[Exception | None] = (),
        forever: bool = False,
        age_ns: int = 0,
    ) -> None:
        super().__init__(settings.camera, clock)
        self._acts = list(acts)
        self._opens = list(opens)
        self._forever = forever
        self._age_ns = age_ns
        self.open_count = 0
        self.close_count = 0

    def open(self) -> None:
        self.open_count += 1
        error = self._opens.pop(0) if self._opens else None
        if error is not None:
            raise error

    def read(self, timeout_s: float) -> Frame:
        if not self._acts:
            self._wait(0.005)
            raise CameraTimeoutError("the script is over")
        self._wait(0.005)
        act = self._acts[0] if self._forever and len(self._acts) == 1 else self._acts.pop(0)
        if isinstance(act, Exception):
            raise act
        return self._frame(act, self.clock.now_ns() - self._age_ns)

    def close(self) -> None:
        self.close_count += 1


def camera_pitch(pitch_deg: float) -> Attitude:
    """The vehicle with its nose `pitch_deg` up and nothing else."""
    return Attitude(0.0, math.radians(pitch_deg), 0.0)
