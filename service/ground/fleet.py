"""What is known of every vehicle, for many browsers at once."""

from __future__ import annotations

import threading
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field

from service.bad_samples import BadSamples
from service.clock import Clock
from service.freshness import ArrivalClock, Freshness
from service.ground.errors import PictureError
from service.ground.history import HistoryPoint, NearestHistory, Reading, reading_of
from service.ground.pictures import check_grey_png, check_jpeg
from service.ground.traffic import Traffic, TrafficView
from service.publisher import keys
from service.publisher.status_wire import StatusSample
from service.publisher.wire import CameraHeader, DepthHeader, ScanSample, WireError

MAX_VEHICLES = 200
"""A peer that invents names must not fill the memory: the longest silent one makes room, else none."""

_MAX_RATE_HZ = 120
"""Samples of one vehicle and topic that are read a second; what comes beyond is counted and left out."""

_MIN_DEPTH_M, _MAX_DEPTH_M = 1e-3, 1e5
"""They travel to the page as 32-bit floats."""

_SECOND_NS = 1_000_000_000


@dataclass(frozen=True)
class Picture:
    """A picture as it came.

    Args:
        number: running number of pictures of this vehicle and topic.
        data: JPEG or PNG.
        header: what came with it.
        born_ns: capture time on the viewer's clock.
    """

    number: int
    data: bytes
    header: CameraHeader | DepthHeader
    born_ns: int


@dataclass(frozen=True)
class VehicleView:
    """One vehicle at one moment.

    Args:
        name: of the vehicle.
        alive: its Zenoh session lives (no sign of fresh data).
        twins: two vehicles seem to have this name.
        scan: the newest scan, however old; None if none came.
        reading: the same in short.
        scan_born_ns: its capture time on the viewer's clock.
        status: the newest status, however old; None if none came.
        status_born_ns: when it came.
        traffic: what comes in.
    """

    name: str
    alive: bool
    twins: bool
    scan: ScanSample | None
    reading: Reading | None
    scan_born_ns: int | None
    status: StatusSample | None
    status_born_ns: int | None
    traffic: TrafficView

    def freshness(self, now_ns: int) -> Freshness:
        """Freshness of the scan."""
        return Freshness.of(None if self.scan_born_ns is None else now_ns - self.scan_born_ns)


@dataclass
class _Vehicle:
    alive: bool = False
    clock: ArrivalClock = field(default_factory=ArrivalClock)
    scan: ScanSample | None = None
    reading: Reading | None = None
    scan_born_ns: int | None = None
    status: StatusSample | None = None
    status_born_ns: int | None = None
    pictures: dict[str, Picture] = field(default_factory=dict)
    picture_count: Counter[str] = field(default_factory=Counter)
    traffic: Traffic = field(default_factory=Traffic)
    history: NearestHistory = field(default_factory=NearestHistory)
    heard_ns: int = 0
    changes: int = 0
    second: int = 0
    read: Counter[str] = field(default_factory=Counter)


class Fleet:
    """Takes samples from any thread; what cannot be understood is counted in `bad_samples`.

    Args:
        clock: the viewer's.
        on_change: called with the vehicle's name after each sample, from the thread that brought it;
            must return at once.
    """

    def __init__(self, clock: Clock, on_change: Callable[[str], None] = lambda _vehicle: None) -> None:
        self._clock = clock
        self._on_change = on_change
        self._lock = threading.Lock()
        self._vehicles: dict[str, _Vehicle] = {}
        self.bad_samples = BadSamples()

    def notify(self, on_change: Callable[[str], None]) -> None:
        """Call `on_change` from now on."""
        self._on_change = on_change

    def hear(self, key: str, payload: bytes, attachment: bytes | None) -> None:
        """Take one sample of a scan, status, camera or depth key. Never raises for what a peer sends."""
        now_ns = self._clock.now_ns()
        name = keys.vehicle_of(key)
        topic = key.rpartition("/")[2]
        with self._lock:
            try:
                vehicle = self._vehicle(name, now_ns)
                vehicle.traffic.hear(topic, len(payload) + len(attachment or b""), now_ns)
                self._read(vehicle, topic, payload, attachment, now_ns)
            except (WireError, PictureError) as error:
                self.bad_samples.note(f"{key[:100]}: {error}")
                return
            vehicle.heard_ns = now_ns
            vehicle.changes += 1
        if name is not None:
            self._on_change(name)

    def hear_alive(self, key: str, alive: bool) -> None:
        """Take the coming or going of a liveliness token."""
        name = keys.vehicle_of(key)
        with self._lock:
            try:
                vehicle = self._vehicle(name, self._clock.now_ns())
            except WireError as error:
                self.bad_samples.last = str(error)
                return
            vehicle.alive = alive
            vehicle.changes += 1
        if name is not None:
            self._on_change(name)

    def views(self) -> list[VehicleView]:
        """All vehicles by name."""
        now_ns = self._clock.now_ns()
        with self._lock:
            return [_view(name, self._vehicles[name], now_ns) for name in sorted(self._vehicles)]

    def view(self, name: str) -> VehicleView | None:
        """One vehicle, or None if it was never heard."""
        with self._lock:
            vehicle = self._vehicles.get(name)
            return None if vehicle is None else _view(name, vehicle, self._clock.now_ns())

    def changes(self, name: str) -> int:
        """A number that grows with every sample of the vehicle."""
        vehicle = self._vehicles.get(name)
        return 0 if vehicle is None else vehicle.changes

    def picture(self, name: str, topic: str) -> Picture | None:
        """The newest picture of a vehicle and topic."""
        vehicle = self._vehicles.get(name)
        return None if vehicle is None else vehicle.pictures.get(topic)

    def forget_pictures(self, watched: set[str]) -> None:
        """Let go of the pictures of all vehicles that nobody watches."""
        with self._lock:
            for name, vehicle in self._vehicles.items():
                if name not in watched:
                    vehicle.pictures.clear()

    def history(self, name: str) -> list[HistoryPoint]:
        """The nearest distances of the last two minutes."""
        with self._lock:
            vehicle = self._vehicles.get(name)
            return [] if vehicle is None else vehicle.history.points(self._clock.now_ns())

    def _vehicle(self, name: str | None, now_ns: int) -> _Vehicle:
        if name is None:
            raise WireError("this key is not one of ours")
        vehicle = self._vehicles.get(name)
        if vehicle is None:
            if len(self._vehicles) >= MAX_VEHICLES:
                self._make_room(now_ns)
            vehicle = self._vehicles[name] = _Vehicle(heard_ns=now_ns)
        return vehicle

    def _make_room(self, now_ns: int) -> None:
        silent = min(self._vehicles, key=lambda name: self._vehicles[name].heard_ns)
        if Freshness.of(now_ns - self._vehicles[silent].heard_ns) is not Freshness.NO_DATA:
            raise WireError(f"there are {MAX_VEHICLES} vehicles already, and all are heard")
        del self._vehicles[silent]

    def _read(
        self, vehicle: _Vehicle, topic: str, payload: bytes, attachment: bytes | None, now_ns: int
    ) -> None:
        if now_ns // _SECOND_NS != vehicle.second:
            vehicle.second = now_ns // _SECOND_NS
            vehicle.read.clear()
        vehicle.read[topic] += 1
        if vehicle.read[topic] > _MAX_RATE_HZ:
            raise WireError(f"more than {_MAX_RATE_HZ} samples in a second: the rest are left out")
        if topic == keys.SCAN:
            scan = ScanSample.decode(payload)
            vehicle.scan, vehicle.reading = scan, reading_of(scan)
            vehicle.scan_born_ns = now_ns - vehicle.clock.hear(scan.captured_ns, scan.age_ms, now_ns)
            vehicle.history.hear(vehicle.reading, vehicle.scan_born_ns)
        elif topic == keys.STATUS:
            vehicle.status, vehicle.status_born_ns = StatusSample.decode(payload), now_ns
        elif topic in (keys.CAMERA, keys.DEPTH):
            vehicle.pictures[topic] = self._picture(vehicle, topic, payload, attachment, now_ns)
        else:
            raise WireError("this topic is not shown")

    @staticmethod
    def _picture(
        vehicle: _Vehicle, topic: str, payload: bytes, attachment: bytes | None, now_ns: int
    ) -> Picture:
        header: CameraHeader | DepthHeader
        if topic == keys.CAMERA:
            header = CameraHeader.decode(attachment or b"")
            check_jpeg(payload)
        else:
            header = DepthHeader.decode(attachment or b"")
            if not _MIN_DEPTH_M <= header.near_m < header.far_m <= _MAX_DEPTH_M:
                raise WireError(
                    f"DepthHeader: a span of {header.near_m:g} to {header.far_m:g} m: "
                    f"{_MIN_DEPTH_M:g} to {_MAX_DEPTH_M:g} m can be shown"
                )
            check_grey_png(payload)
        vehicle.picture_count[topic] += 1
        age_ns = vehicle.clock.age_ns(header.captured_ns, header.age_ms, now_ns)
        return Picture(vehicle.picture_count[topic], payload, header, now_ns - age_ns)


def _view(name: str, vehicle: _Vehicle, now_ns: int) -> VehicleView:
    return VehicleView(
        name=name,
        alive=vehicle.alive,
        twins=vehicle.clock.has_twins(now_ns),
        scan=vehicle.scan,
        reading=vehicle.reading,
        scan_born_ns=vehicle.scan_born_ns,
        status=vehicle.status,
        status_born_ns=vehicle.status_born_ns,
        traffic=vehicle.traffic.view(now_ns),
    )
