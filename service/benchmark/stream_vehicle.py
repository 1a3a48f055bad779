"""The vehicle of the stream benchmark: a process that publishes rendered pictures as the service does."""

from __future__ import annotations

import multiprocessing
import time
from dataclasses import replace
from multiprocessing.sharedctypes import Synchronized
from multiprocessing.synchronize import Event
from types import TracebackType
from typing import Any, Self

import cv2
import numpy as np

from service.benchmark.pictures import CAMERA, HEIGHT_M, LEVEL, MOUNT, SCENE, SEED
from service.clock import MonotonicClock
from service.errors import PublisherError
from service.frame import Frame
from service.pipeline import PerceptionResult
from service.process_end import end_process
from service.publisher.publisher import ZenohPublisher
from service.publisher.status_wire import StatusSample
from service.publisher.wire import ScanSample
from service.settings.zenoh import ZenohSettings
from service.telemetry import Telemetry
from uavdepth.depth.codec import encode_depth_png
from uavdepth.depth.depth_map import DepthMap
from uavdepth.scan.scanner import ObstacleScanner
from uavdepth.scenes import load_scene

FPS = 15.0
_PICTURES = 4
_READY_S = 180.0
_STOP_S = 5.0
_STATUS_PERIOD = 7
"""One status for so many scans: about two a second."""


class StreamVehicle:
    """The vehicle in a process of its own. A context manager.

    Args:
        name: of the vehicle.
        settings: `[zenoh]`.
    """

    def __init__(self, name: str, settings: ZenohSettings) -> None:
        context = multiprocessing.get_context("spawn")
        self._stop, self._ready = context.Event(), context.Event()
        self._offered = context.Value("d", 0.0)
        self._process = context.Process(
            target=_fly,
            args=(name, settings.model_dump(), self._stop, self._ready, self._offered),
            daemon=True,
        )

    def __enter__(self) -> Self:
        self._process.start()
        if not self._ready.wait(_READY_S):
            self._process.terminate()
            raise PublisherError(f"the vehicle has not started within {_READY_S:g} s")
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stop.set()
        self._process.join(_STOP_S)
        if self._process.is_alive():
            self._process.terminate()
            self._process.join()

    @property
    def offered_kbit_per_s(self) -> float:
        """What scans, depth and camera would take in full size."""
        return float(self._offered.value)


def _rendered_results(count: int = _PICTURES) -> list[PerceptionResult]:
    """Pictures along the benchmark's street with their true depth and scan."""
    scene, scanner = load_scene(SCENE, SEED), ObstacleScanner(CAMERA, MOUNT)
    results = []
    for number in range(count):
        view = scene.render(CAMERA, MOUNT, (1.5 * number, 0.0, -HEIGHT_M), LEVEL)
        scan = scanner.scan(view.depth_m, LEVEL, HEIGHT_M)
        results.append(
            PerceptionResult(
                Frame(view.image_bgr, 0, number),
                Telemetry(0, LEVEL, HEIGHT_M),
                DepthMap(np.asarray(view.depth_m, np.float32)),
                None,
                scan,
                None,
            )
        )
    return results


def _offered_kbit_per_s(settings: ZenohSettings, result: PerceptionResult) -> float:
    scan = ScanSample.of(result.scan, index=0, captured_ns=0, age_ms=0.0, trouble=None)
    bytes_per_s = min(FPS, settings.scan_rate_hz) * len(scan.encode())
    if settings.profile != "scan-only" and settings.camera:
        quality = [cv2.IMWRITE_JPEG_QUALITY, settings.camera_quality]
        jpeg = cv2.imencode(".jpg", result.frame.image_bgr, quality)[1]
        bytes_per_s += min(FPS, settings.camera_rate_hz) * len(jpeg)
    if settings.profile == "full" and result.depth is not None:
        depth = encode_depth_png(result.depth.depth_m, settings.depth_near_m, settings.depth_far_m)
        bytes_per_s += min(FPS, settings.depth_rate_hz) * len(depth)
    return 8e-3 * bytes_per_s


def _fly(name: str, table: dict[str, Any], stop: Event, ready: Event, offered: Synchronized[float]) -> None:
    results, clock, settings = _rendered_results(), MonotonicClock(), ZenohSettings(**table)
    offered.value = _offered_kbit_per_s(settings, results[0])
    publisher = ZenohPublisher(settings, name, CAMERA, clock)
    publisher.start()
    ready.set()
    status = StatusSample(
        vehicle=name,
        state="ACTIVE",
        uptime_s=0.0,
        frames_per_s=FPS,
        obstacle_messages=0,
        camera="delivering",
        link_connected=True,
        memory_mib=0.0,
    )
    number, begun_s = 0, time.monotonic()
    while not stop.wait(max(0.0, begun_s + number / FPS - time.monotonic())):
        result = results[number % len(results)]
        frame = Frame(result.frame.image_bgr, clock.now_ns(), number)
        publisher.offer(replace(result, frame=frame))
        if number % _STATUS_PERIOD == 0:
            publisher.offer_status(status)
        number += 1
    publisher.close()
    end_process(0)
