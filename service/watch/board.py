"""What is known of each vehicle, and how old it is."""

from __future__ import annotations

import threading
from dataclasses import dataclass, field

from service.bad_samples import BadSamples
from service.freshness import ArrivalClock, Freshness
from service.publisher import keys
from service.publisher.status_wire import StatusSample
from service.publisher.wire import ScanSample, WireError

_MAX_VEHICLES = 200
"""A peer that invents names must not fill the memory."""


@dataclass
class _Vehicle:
    alive: bool = False
    clock: ArrivalClock = field(default_factory=ArrivalClock)
    scan: ScanSample | None = None
    scan_born_ns: int | None = None
    status: StatusSample | None = None
    status_ns: int | None = None
    scans: int = 0


@dataclass(frozen=True)
class VehicleView:
    """One vehicle at one moment.

    Args:
        name: of the vehicle.
        alive: its Zenoh session lives (liveliness; no sign of fresh data).
        freshness: of the newest scan.
        age_s: since its picture was taken, seconds; None before the first.
        scan: the newest scan, None if there is none or it is too old to show.
        status: the newest status, None if there is none or it is too old to show.
        scans: that arrived since the start.
    """

    name: str
    alive: bool
    freshness: Freshness
    age_s: float | None
    scan: ScanSample | None
    status: StatusSample | None
    scans: int


class Board:
    """Collects samples from any thread; what cannot be understood is counted in `bad_samples`."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._vehicles: dict[str, _Vehicle] = {}
        self.bad_samples = BadSamples()

    def hear(self, key: str, payload: bytes, now_ns: int) -> None:
        """Take one sample of a `scan` or `status` key."""
        vehicle = keys.vehicle_of(key)
        topic = key.rpartition("/")[2]
        with self._lock:
            try:
                if vehicle is None or topic not in (keys.SCAN, keys.STATUS):
                    raise WireError(f"key {key[:100]!r} is not one of ours")
                if topic == keys.SCAN:
                    scan = ScanSample.decode(payload)
                    entry = self._entry(vehicle)
                    entry.scan, entry.scans = scan, entry.scans + 1
                    entry.scan_born_ns = now_ns - entry.clock.hear(scan.captured_ns, scan.age_ms, now_ns)
                else:
                    status = StatusSample.decode(payload)
                    entry = self._entry(vehicle)
                    entry.status, entry.status_ns = status, now_ns
            except WireError as error:
                self.bad_samples.note(str(error))

    def hear_alive(self, key: str, alive: bool) -> None:
        """Take the coming or going of a liveliness token."""
        vehicle = keys.vehicle_of(key)
        if vehicle is None:
            return
        with self._lock:
            try:
                self._entry(vehicle).alive = alive
            except WireError as error:
                self.bad_samples.last = str(error)

    def vehicles(self, now_ns: int) -> list[VehicleView]:
        """All vehicles by name, as they are to be shown now."""
        with self._lock:
            return [self._view(name, entry, now_ns) for name, entry in sorted(self._vehicles.items())]

    def _entry(self, vehicle: str) -> _Vehicle:
        entry = self._vehicles.get(vehicle)
        if entry is None:
            if len(self._vehicles) >= _MAX_VEHICLES:
                raise WireError(f"more than {_MAX_VEHICLES} vehicles: {vehicle!r} is left out")
            entry = self._vehicles[vehicle] = _Vehicle()
        return entry

    @staticmethod
    def _view(name: str, entry: _Vehicle, now_ns: int) -> VehicleView:
        age_ns = None if entry.scan_born_ns is None else now_ns - entry.scan_born_ns
        freshness = Freshness.of(age_ns)
        status_age_ns = None if entry.status_ns is None else now_ns - entry.status_ns
        return VehicleView(
            name=name,
            alive=entry.alive,
            freshness=freshness,
            age_s=None if age_ns is None else age_ns / 1e9,
            scan=None if freshness is Freshness.NO_DATA else entry.scan,
            status=None if Freshness.of(status_age_ns) is Freshness.NO_DATA else entry.status,
            scans=entry.scans,
        )
