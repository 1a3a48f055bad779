"""A fleet through one router: what two stations receive, how late, and what it takes of memory."""

from __future__ import annotations

import multiprocessing
import threading
import time
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from multiprocessing.synchronize import Event
from pathlib import Path
from typing import Any

import numpy as np
import zenoh

from service.demo.plan import free_zenoh_endpoint
from service.errors import PublisherError
from service.publisher import keys
from service.publisher.session import Role, open_session
from service.publisher.topics import PictureTopics, ScanTopics
from service.publisher.wire import CameraHeader, Intrinsics, ScanSample
from uavdepth.scan.obstacle_scan import ObstacleScan, SectorState, sector_bearings_deg

SCAN_HZ = 15.0
_PICTURE_EVERY = 3
"""One picture for so many scans: five a second."""

_PICTURE_BYTES = 8_000
_READY_S = 90.0
_STOP_S = 10.0
_SETTLE_S = 3.0


@dataclass(frozen=True)
class FleetFigures:
    """One run.

    Args:
        vehicles, stations: how many.
        sent_scans, sent_pictures: of all vehicles in the time measured.
        scans_delivered, pictures_delivered: part of them that each station got, the worst of the stations.
        scan_ms_p50, scan_ms_p95, picture_ms_p50, picture_ms_p95: from sending to the station.
        router_mib: resident memory of the router's process before the first vehicle came.
        router_mib_per_vehicle: what each vehicle added to it.
    """

    vehicles: int
    stations: int
    sent_scans: int
    sent_pictures: int
    scans_delivered: float
    pictures_delivered: float
    scan_ms_p50: float
    scan_ms_p95: float
    picture_ms_p50: float
    picture_ms_p95: float
    router_mib: float
    router_mib_per_vehicle: float

    def as_json(self) -> dict[str, Any]:
        """Plain values."""
        return asdict(self)


class _Station:
    def __init__(self) -> None:
        self.scans: list[tuple[int, float]] = []
        self.pictures: list[tuple[int, float]] = []

    def hear_scan(self, sample: zenoh.Sample) -> None:
        now_ns = time.monotonic_ns()
        stamp = ScanSample.decode(sample.payload.to_bytes())
        self.scans.append((stamp.captured_ns, (now_ns - stamp.captured_ns) / 1e6))

    def hear_picture(self, sample: zenoh.Sample) -> None:
        now_ns = time.monotonic_ns()
        attachment = b"" if sample.attachment is None else sample.attachment.to_bytes()
        stamp = CameraHeader.decode(attachment)
        self.pictures.append((stamp.captured_ns, (now_ns - stamp.captured_ns) / 1e6))


def measure_fleet(vehicles: int, stations: int, seconds: float) -> FleetFigures:
    """Run router and vehicles in processes of their own, the stations here.

    Raises:
        PublisherError: a process that does not start, or a station that hears nothing.
    """
    endpoint = free_zenoh_endpoint()
    context = multiprocessing.get_context("spawn")
    stop, up, flying = context.Event(), context.Event(), context.Event()
    router = context.Process(target=_route, args=(endpoint, stop, up), daemon=True)
    fleet = context.Process(target=_fly, args=(vehicles, endpoint, stop, flying), daemon=True)
    with ExitStack() as stack:
        for process in (router, fleet):
            stack.callback(_end, process, stop)
        router.start()
        _await(up, "the router")
        heard = [_Station() for _ in range(stations)]
        for station in heard:
            scans = stack.enter_context(open_session((), (endpoint,), None, Role.STATION))
            pictures = stack.enter_context(open_session((), (endpoint,), None, Role.STATION))
            scans.declare_subscriber(keys.key("*", keys.SCAN), station.hear_scan)
            pictures.declare_subscriber(keys.key("*", keys.CAMERA), station.hear_picture)
        pause = threading.Event()
        pause.wait(1.0)
        before_mib = _resident_mib(router.pid)
        fleet.start()
        _await(flying, "the fleet")
        pause.wait(_SETTLE_S)
        begun_ns = time.monotonic_ns()
        pause.wait(seconds)
        ended_ns = time.monotonic_ns()
        after_mib = _resident_mib(router.pid)
        pause.wait(1.0)
        scans_ms, scans_part = _delivered([s.scans for s in heard], begun_ns, ended_ns, vehicles * SCAN_HZ)
        rate = vehicles * SCAN_HZ / _PICTURE_EVERY
        pictures_ms, pictures_part = _delivered([s.pictures for s in heard], begun_ns, ended_ns, rate)
    return FleetFigures(
        vehicles=vehicles,
        stations=stations,
        sent_scans=round(vehicles * SCAN_HZ * seconds),
        sent_pictures=round(rate * seconds),
        scans_delivered=scans_part,
        pictures_delivered=pictures_part,
        scan_ms_p50=round(float(np.percentile(scans_ms, 50)), 1),
        scan_ms_p95=round(float(np.percentile(scans_ms, 95)), 1),
        picture_ms_p50=round(float(np.percentile(pictures_ms, 50)), 1),
        picture_ms_p95=round(float(np.percentile(pictures_ms, 95)), 1),
        router_mib=round(before_mib, 1),
        router_mib_per_vehicle=round((after_mib - before_mib) / vehicles, 2),
    )


def _delivered(
    stations: list[list[tuple[int, float]]], begun_ns: int, ended_ns: int, rate_hz: float
) -> tuple[list[float], float]:
    """Latencies of what was sent in the window, and the part of it that the worst station got."""
    inside = [[late for at_ns, late in heard if begun_ns <= at_ns < ended_ns] for heard in stations]
    if not all(inside):
        raise PublisherError("a station has heard nothing")
    sent = rate_hz * (ended_ns - begun_ns) / 1e9
    return [late for heard in inside for late in heard], round(min(len(heard) for heard in inside) / sent, 3)


def _route(endpoint: str, stop: Event, up: Event) -> None:
    with open_session((endpoint,), (), None, Role.STATION):
        up.set()
        stop.wait()


def _fly(vehicles: int, endpoint: str, stop: Event, flying: Event) -> None:
    camera = Intrinsics(width=320, height=160, fx=160.0, fy=160.0, cx=159.5, cy=79.5)
    state = np.full(72, SectorState.CLEAR, np.uint8)
    scan = ObstacleScan(np.full(72, np.nan, np.float32), state, sector_bearings_deg(), 0.2, 20.0)
    picture = bytes(_PICTURE_BYTES)
    with ExitStack() as stack:
        topics = []
        for number in range(vehicles):
            # As the service does it: scans and pictures have a session each.
            scans = stack.enter_context(open_session((), (endpoint,)))
            pictures = stack.enter_context(open_session((), (endpoint,)))
            name = f"uav{number + 1}"
            topics.append((ScanTopics(scans, name), PictureTopics(pictures, name)))
        flying.set()
        turn, begun_s = 0, time.monotonic()
        while not stop.is_set():
            for number, (scan_topics, picture_topics) in enumerate(topics):
                # Spread over the period, as vehicles are that know nothing of each other.
                due_s = begun_s + (turn + number / vehicles) / SCAN_HZ
                stop.wait(max(0.0, due_s - time.monotonic()))
                at_ns = time.monotonic_ns()
                sample = ScanSample.of(scan, index=turn, captured_ns=at_ns, age_ms=0.0, trouble=None)
                scan_topics.scan.put(sample.encode())
                if turn % _PICTURE_EVERY == 0:
                    header = CameraHeader(index=turn, captured_ns=at_ns, age_ms=0.0, camera=camera)
                    picture_topics.put(keys.CAMERA, picture, header.encode())
            turn += 1


def _await(event: Event, what: str) -> None:
    if not event.wait(_READY_S):
        raise PublisherError(f"{what} has not started within {_READY_S:g} s")


def _end(process: Any, stop: Event) -> None:
    stop.set()
    if process.pid is None:
        return
    process.join(_STOP_S)
    if process.is_alive():
        process.terminate()
        process.join()


def _resident_mib(pid: int | None) -> float:
    """Resident memory of a process, 0 where the system does not tell."""
    try:
        lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    except OSError:
        return 0.0
    kib = [int(line.split()[1]) for line in lines if line.startswith("VmRSS:")]
    return kib[0] / 1024 if kib else 0.0
