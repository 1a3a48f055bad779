"""Vehicles made of Zenoh samples, and a ground station on a port of its own."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field

import cv2
import numpy as np
import uvicorn
import zenoh
from program_fakes import free_port, wait_until

from service.clock import MonotonicClock
from service.ground.access import Access
from service.ground.app import GroundApp
from service.ground.fleet import Fleet
from service.ground.hub import Hub
from service.ground.listener import FleetListener
from service.ground.server import bind, make_server
from service.publisher import keys
from service.publisher.session import open_session
from service.publisher.status_wire import StatusSample
from service.publisher.wire import CameraHeader, DepthHeader, Intrinsics, ScanSample
from uavdepth.camera import CameraModel
from uavdepth.depth.codec import encode_depth_png
from uavdepth.scan.obstacle_scan import ObstacleScan, SectorState, sector_bearings_deg

CAMERA = CameraModel.from_fov(64, 40, horizontal_fov_deg=90.0)
MILLISECOND = 1_000_000
SECOND = 1_000_000_000


def scan_sample(
    distance_m: float | None = 6.0,
    *,
    bearing_deg: float = 0.0,
    captured_ns: int = 0,
    index: int = 0,
    trouble: str | None = None,
    age_ms: float = 50.0,
) -> ScanSample:
    """Clear from -40 to 40 degrees but for one obstacle; None for no obstacle."""
    bearings = sector_bearings_deg()
    state = np.full(72, SectorState.UNKNOWN, np.uint8)
    distance = np.full(72, np.nan, np.float32)
    if trouble is None:
        state[np.abs(bearings) <= 40] = SectorState.CLEAR
        if distance_m is not None:
            at = int(np.argmin(np.abs(bearings - bearing_deg)))
            state[at], distance[at] = SectorState.OBSTACLE, distance_m
    scan = ObstacleScan(distance, state, bearings, 0.2, 20.0)
    return ScanSample.of(scan, index=index, captured_ns=captured_ns, age_ms=age_ms, trouble=trouble)


def status_sample_of(name: str, **changes: object) -> StatusSample:
    """A vehicle in flight."""
    values: dict[str, object] = {
        "vehicle": name,
        "state": "ACTIVE",
        "uptime_s": 9.0,
        "frames_per_s": 14.8,
        "obstacle_messages": 130,
        "obstacle_rate_hz": 14.6,
        "latency_ms_p50": 61.0,
        "latency_ms_p95": 88.0,
        "scale_factor": 1.25,
        "scale_relative_sigma": 0.05,
        "scale_age_s": 0.0,
        "scale_sources": ("ground",),
        "height_m": 3.25,
        "altitude_m": 3.4,
        "speed_mps": 2.1,
        "mode": "GUIDED",
        "armed": True,
        "autopilot": "ardupilot",
        "camera": "delivering",
        "link_connected": True,
        "recording": True,
        "memory_mib": 150.0,
        **changes,
    }
    return StatusSample.model_validate(values)


def jpeg(value: int, camera: CameraModel = CAMERA) -> bytes:
    """A picture in one shade."""
    return cv2.imencode(".jpg", np.full((camera.height, camera.width, 3), value, np.uint8))[1].tobytes()


def depth_png(metres: float, camera: CameraModel = CAMERA) -> bytes:
    """The same depth everywhere but for the top left quarter, which is unknown."""
    depth = np.full((camera.height, camera.width), metres, np.float32)
    depth[: camera.height // 2, : camera.width // 2] = np.nan
    return encode_depth_png(depth, 0.5, 60.0)


def camera_header(captured_ns: int = 0, index: int = 0) -> CameraHeader:
    return CameraHeader(index=index, captured_ns=captured_ns, age_ms=60.0, camera=Intrinsics.of(CAMERA))


def depth_header(captured_ns: int = 0, index: int = 0) -> DepthHeader:
    return DepthHeader(
        index=index,
        captured_ns=captured_ns,
        age_ms=60.0,
        near_m=0.5,
        far_m=60.0,
        camera=Intrinsics.of(CAMERA),
    )


@dataclass
class Vehicle:
    """A vehicle that says what it is told to, as often as it is told to."""

    session: zenoh.Session
    name: str
    status: dict[str, object] = field(default_factory=dict)
    spoken: int = 0

    def __post_init__(self) -> None:
        self._token = self.session.liveliness().declare_token(keys.key(self.name, keys.ALIVE))

    def say(self, distance_m: float | None = 6.0, *, trouble: str | None = None, shade: int = 128) -> None:
        """One sample of each topic, captured now."""
        self.spoken += 1
        now_ns = MonotonicClock().now_ns()
        index = self.spoken
        scan = scan_sample(distance_m, captured_ns=now_ns, index=index, trouble=trouble)
        self._put(keys.SCAN, scan.encode())
        self._put(keys.STATUS, status_sample_of(self.name, **self.status).encode())
        self._put(keys.CAMERA, jpeg(shade), camera_header(now_ns, index).encode())
        if distance_m is not None:
            self._put(keys.DEPTH, depth_png(distance_m), depth_header(now_ns, index).encode())

    def die(self) -> None:
        """No more liveliness."""
        self._token.undeclare()

    def _put(self, topic: str, payload: bytes, attachment: bytes | None = None) -> None:
        self.session.put(keys.key(self.name, topic), payload, attachment=attachment)


class Talk:
    """Calls something again and again in a thread of its own, as a vehicle speaks."""

    def __init__(self, speak: Callable[[], None], period_s: float = 0.05) -> None:
        self._speak = speak
        self._period_s = period_s
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self) -> Talk:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def stop(self) -> None:
        """Fall silent."""
        self._stopping.set()
        self._thread.join(10)

    def _run(self) -> None:
        while not self._stopping.wait(self._period_s):
            self._speak()


@dataclass
class RunningStation:
    """A ground station and the Zenoh session of the vehicles that it hears."""

    port: int
    fleet: Fleet
    hub: Hub
    vehicles: zenoh.Session

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.port}"

    @property
    def live_url(self) -> str:
        return f"ws://127.0.0.1:{self.port}/live"


@contextmanager
def station(token: str | None = None, *, listens: bool = False) -> Iterator[RunningStation]:
    """A ground station on the loopback, and a session that vehicles may use.

    Args:
        token: asked for by the page.
        listens: the vehicles connect to the station, not the station to them.
    """
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    clock = MonotonicClock()
    fleet = Fleet(clock)
    with ExitStack() as stack:
        server_socket = stack.enter_context(bind("127.0.0.1", 0))
        if listens:
            listener = stack.enter_context(FleetListener([endpoint], [], fleet, clock))
            vehicles = stack.enter_context(open_session([], [endpoint]))
        else:
            vehicles = stack.enter_context(open_session([endpoint], []))
            listener = stack.enter_context(FleetListener([], [endpoint], fleet, clock))
        port: int = server_socket.getsockname()[1]
        hub = Hub(fleet, listener, (endpoint,), clock)
        app = GroundApp(hub, Access(token), port)
        server: uvicorn.Server = make_server(app.asgi, None)
        thread = threading.Thread(target=server.run, args=([server_socket],), daemon=True)
        thread.start()
        try:
            wait_until(lambda: server.started)
            wait_until(lambda: listener.peer_count() > 0)
            yield RunningStation(port, fleet, hub, vehicles)
        finally:
            server.should_exit = True
            thread.join(20)
