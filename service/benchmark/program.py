"""The whole program: how soon it speaks, how fast it is, how much memory it takes."""

from __future__ import annotations

import os
import tempfile
import time
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from service.benchmark.pictures import CAMERA, FPS, HEIGHT_M, MOUNT, write_pictures
from service.clock import MonotonicClock
from service.demo.companion import Companion
from service.demo.observer import GroundObserver
from service.demo.plan import free_zenoh_endpoint
from service.fake_autopilot.fake_autopilot import FakeAutopilot
from service.fake_autopilot.pilot import Pilot
from uavdepth.errors import UavDepthError

VEHICLE = "benchmark"
_TIMEOUT_S = 30.0
_POLL_S = 0.005


@dataclass(frozen=True)
class ProgramFigures:
    """`uavdepth run` on an image folder at 15 pictures/s, 640x320, beside a hovering fake ArduCopter.

    Args:
        first_message_s: from the start of the process to the first OBSTACLE_DISTANCE; the vehicle is in
            the air, so that only trusted distances are sent.
        obstacle_rate_hz: OBSTACLE_DISTANCE as received over the rest of the run.
        frames_per_s: measured by the program; 15 are offered.
        latency_ms_p50, latency_ms_p95: from a picture's due time to its message on the line, as the program
            reports it: decoding, network and waiting count.
        peak_memory_mib: largest resident memory (VmHWM).
        load_before: programs that wanted the processors in the minute before. Near 0 on a quiet machine; the
            other figures hold for the load that they were taken under.
    """

    first_message_s: float
    obstacle_rate_hz: float
    frames_per_s: float | None
    latency_ms_p50: float | None
    latency_ms_p95: float | None
    peak_memory_mib: float
    load_before: float


def measure_program(model: str, pictures: list[NDArray[np.uint8]], seconds: float) -> ProgramFigures:
    """Run the program for `seconds` after its first message and measure it from outside.

    Raises:
        UavDepthError: no message comes within 30 s, or the program ends by itself.
    """
    load_before = os.getloadavg()[0]
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="uavdepth-benchmark-")))
        pictures_folder = folder / "pictures"
        pictures_folder.mkdir()
        write_pictures(pictures, pictures_folder)
        autopilot = stack.enter_context(
            FakeAutopilot("ardupilot", "tcp:127.0.0.1:0", parameters={"ARMING_SKIPCHK": -1.0})
        )
        stack.enter_context(Pilot(autopilot.address)).take_off(HEIGHT_M)
        zenoh_endpoint = free_zenoh_endpoint()
        configuration = folder / "uavdepth.toml"
        configuration.write_text(
            _toml(model, pictures_folder, autopilot.address, zenoh_endpoint), encoding="utf-8"
        )
        begun_s = time.monotonic()
        companion = stack.enter_context(Companion(configuration, folder / "log"))
        while autopilot.truth().obstacle_messages == 0:
            companion.check()
            if time.monotonic() - begun_s > _TIMEOUT_S:
                raise UavDepthError(f"no OBSTACLE_DISTANCE within {_TIMEOUT_S:g} s")
            time.sleep(_POLL_S)
        first_s = time.monotonic() - begun_s
        observer = GroundObserver(VEHICLE, zenoh_endpoint, MonotonicClock())
        stack.callback(observer.close)
        start = autopilot.truth()
        time.sleep(seconds)
        end = autopilot.truth()
        companion.check()
        status = observer.status
        rate_hz = (end.obstacle_messages - start.obstacle_messages) / (end.time_s - start.time_s)
        return ProgramFigures(
            first_message_s=round(first_s, 2),
            obstacle_rate_hz=round(rate_hz, 1),
            frames_per_s=None if status is None else round(status.frames_per_s, 1),
            latency_ms_p50=None if status is None else status.latency_ms_p50,
            latency_ms_p95=None if status is None else status.latency_ms_p95,
            peak_memory_mib=companion.peak_memory_mib,
            load_before=round(load_before, 1),
        )


def _toml(model: str, pictures: Path, autopilot_endpoint: str, zenoh_endpoint: str) -> str:
    return f"""\
[vehicle]
name = "{VEHICLE}"

[camera]
source = '{pictures}'
width = {CAMERA.width}
height = {CAMERA.height}
horizontal_fov_deg = 90.0
fps = {FPS}
loop = true

[mount]
pitch_deg = {MOUNT.pitch_deg}

[model]
path = '{model}'

[autopilot]
endpoint = "{autopilot_endpoint}"

[zenoh]
listen = ["{zenoh_endpoint}"]
"""
