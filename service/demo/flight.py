"""The demo's flight: take off, fly north, and see what happens."""

from __future__ import annotations

import math
import tempfile
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

from service.clock import MonotonicClock
from service.demo.companion import Companion
from service.demo.observer import GroundObserver, Pictures
from service.demo.plan import ABOVE_M, BELOW_M, VEHICLE, DemoPlan, free_zenoh_endpoint, write_configuration
from service.demo.report import DemoReport, Latency
from service.demo.truth import AHEAD_DEG, RayWorld, true_distance_ahead_m
from service.fake_autopilot.fake_autopilot import FakeAutopilot, Truth
from service.fake_autopilot.pilot import Pilot, PilotError
from service.publisher.wire import ScanSample
from uavdepth.errors import UavDepthError
from uavdepth.scan.obstacle_scan import SectorState
from uavdepth.scenes import load_scene, parse_scene

SERVICE_TIMEOUT_S = 180.0
"""Longest wait for the first OBSTACLE_DISTANCE: the very first run compiles the renderer's shading."""

REST_M = 0.8
REST_S = 3.0
"""The vehicle has stopped when it stayed within so few metres for so long, the stick still forward."""

FLEW_SHARE = 0.5
ON_THE_WAY_M = 14.0
"""The first picture is kept when the scan shows something ahead nearer than this."""

_POLL_S = 0.05


class Phase(Enum):
    """Where the demo is."""

    BUILDING = "building the world"
    WAITING = "waiting for the service (the very first run compiles the renderer)"
    CLIMBING = "taking off"
    FLYING = "flying north"
    ENDED = "ended"


@dataclass(frozen=True)
class Moment:
    """What the ground saw at one moment."""

    pictures: Pictures
    scan: ScanSample


class DemoFlight:
    """One flight of the demo. `run` blocks; the other members may be read from other threads meanwhile."""

    def __init__(self, plan: DemoPlan) -> None:
        self.plan = plan
        self.phase = Phase.BUILDING
        self.observer: GroundObserver | None = None
        self.autopilot: FakeAutopilot | None = None
        self.on_the_way: Moment | None = None
        self.at_the_end: Moment | None = None
        self.service_log = ""
        self._abandoned = threading.Event()

    def abandon(self) -> None:
        """End the flight soon."""
        self._abandoned.set()

    def run(self) -> DemoReport:
        """Fly.

        Raises:
            UavDepthError: the world, the autopilot or the service cannot be started, or the vehicle
                refuses; the text says why.
        """
        scene = load_scene(*parse_scene(self.plan.scene))
        with ExitStack() as stack:
            folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="uavdepth-demo-")))
            stack.callback(self._end, folder / "service.log")
            self.autopilot = stack.enter_context(
                FakeAutopilot(
                    self.plan.flavor, "tcp:127.0.0.1:0", scene=scene, parameters=self.plan.parameters
                )
            )
            companion = None if self.plan.blind else self._start_service(stack, folder)
            pilot = stack.enter_context(Pilot(self.autopilot.address))
            self._climb(pilot, companion)
            return self._fly(pilot, companion, scene)

    def _end(self, log: Path) -> None:
        """Keep the service's words; the folder that they lie in goes."""
        self.phase = Phase.ENDED
        self.service_log = log.read_text(errors="replace") if log.exists() else ""

    def _start_service(self, stack: ExitStack, folder: Path) -> Companion:
        self.phase = Phase.WAITING
        autopilot = self._autopilot
        zenoh_endpoint = free_zenoh_endpoint()
        configuration = write_configuration(folder, self.plan, autopilot.address, zenoh_endpoint)
        companion = stack.enter_context(Companion(configuration, folder / "service.log"))
        self.observer = GroundObserver(VEHICLE, zenoh_endpoint, MonotonicClock())
        stack.callback(self.observer.close)
        self._wait_until(
            lambda: autopilot.truth().obstacle_messages > 0,
            SERVICE_TIMEOUT_S,
            "no OBSTACLE_DISTANCE from the service",
            companion,
        )
        return companion

    def _climb(self, pilot: Pilot, companion: Companion | None) -> None:
        self.phase = Phase.CLIMBING
        try:
            pilot.take_off(self.plan.height_m)
        except PilotError:
            if companion is not None:
                companion.check()
            raise

    def _fly(self, pilot: Pilot, companion: Companion | None, scene: RayWorld) -> DemoReport:
        self.phase = Phase.FLYING
        start = self._autopilot.truth()
        pilot.fly_forward(self.plan.speed_mps)
        flew, track = False, deque[tuple[float, float, float]]()
        reason = f"still flying after {self.plan.seconds:g} s"
        truth = start
        stopped = False
        while truth.time_s - start.time_s < self.plan.seconds:
            if self._abandoned.wait(_POLL_S):
                reason = "interrupted"
                break
            if companion is not None:
                companion.check()
            self._keep_moment()
            truth = self._autopilot.truth()
            speed_mps = math.hypot(*truth.velocity_ned_mps[:2])
            flew = flew or speed_mps >= FLEW_SHARE * self.plan.speed_mps
            if truth.collided:
                reason = "hit something"
                break
            track.append((truth.time_s, *truth.position_ned_m[:2]))
            while truth.time_s - track[0][0] > REST_S:
                track.popleft()
            if flew and _is_at_rest(track):
                reason, stopped = "came to rest in front of it", True
                break
        return self._report(scene, start, truth, flew=flew, stopped=stopped, reason=reason)

    def _report(
        self, scene: RayWorld, start: Truth, end: Truth, *, flew: bool, stopped: bool, reason: str
    ) -> DemoReport:
        observer = self.observer
        status = None if observer is None else observer.status
        scan = None if observer is None else observer.scan
        self.at_the_end = None if observer is None else _moment(observer)
        flown_s = max(end.time_s - start.time_s, 1e-6)
        return DemoReport(
            scene=self.plan.scene,
            flavor=self.plan.flavor,
            blind=self.plan.blind,
            frames=0 if scan is None else scan.index + 1,
            fps=None if status is None else status.frames_per_s,
            obstacle_messages=end.obstacle_messages,
            obstacle_rate_hz=(end.obstacle_messages - start.obstacle_messages) / flown_s,
            latency_ms=Latency(
                None if status is None else status.latency_ms_p50,
                None if status is None else status.latency_ms_p95,
            ),
            flew=flew,
            stopped=stopped,
            collided=end.collided,
            stop_distance_m=None if scan is None else nearest_ahead_m(scan),
            true_distance_m=true_distance_ahead_m(
                scene,
                end.position_ned_m,
                end.attitude.yaw_rad,
                BELOW_M,
                ABOVE_M,
            ),
            zenoh_samples=0 if observer is None else observer.samples,
            flown_s=flown_s,
            reason=reason,
        )

    def _keep_moment(self) -> None:
        """Keep the first moment at which the scan shows something near ahead."""
        if self.on_the_way is not None or self.observer is None:
            return
        scan = self.observer.scan
        ahead_m = None if scan is None else nearest_ahead_m(scan)
        if ahead_m is not None and ahead_m < ON_THE_WAY_M:
            self.on_the_way = _moment(self.observer)

    def _wait_until(
        self, is_so: Callable[[], bool], timeout_s: float, problem: str, companion: Companion
    ) -> None:
        until_s = time.monotonic() + timeout_s
        while not is_so():
            companion.check()
            if self._abandoned.wait(_POLL_S):
                raise UavDepthError("the demo was interrupted")
            if time.monotonic() > until_s:
                raise UavDepthError(f"{problem} within {timeout_s:g} s{self._trouble()}")

    def _trouble(self) -> str:
        status = None if self.observer is None else self.observer.status
        return "" if status is None or status.trouble is None else f": {status.trouble}"

    @property
    def _autopilot(self) -> FakeAutopilot:
        if self.autopilot is None:
            raise UavDepthError("the demo's autopilot was not started")
        return self.autopilot


def _moment(observer: GroundObserver) -> Moment | None:
    pictures, scan = observer.pictures(), observer.scan
    return None if pictures is None or scan is None else Moment(pictures, scan)


def _is_at_rest(track: Sequence[tuple[float, float, float]]) -> bool:
    """Whether the vehicle stayed within `REST_M` for `REST_S`; the track is of time, north and east."""
    times_s, norths_m, easts_m = zip(*track, strict=True)
    reach_m = math.hypot(max(norths_m) - min(norths_m), max(easts_m) - min(easts_m))
    return times_s[-1] - times_s[0] > REST_S - 0.2 and reach_m < REST_M


def nearest_ahead_m(sample: ScanSample) -> float | None:
    """Nearest obstacle of a scan within `AHEAD_DEG` of the nose, metres, or None."""
    scan = sample.scan
    ahead = (abs(scan.bearing_deg) <= AHEAD_DEG) & (scan.state == SectorState.OBSTACLE)
    return float(scan.distance_m[ahead].min()) if ahead.any() else None
