"""Records for the tests of recorder and replay."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from link_support import Voice
from mcap.reader import make_reader
from program_fakes import HEIGHT, LEVEL, WIDTH, make_settings

from service.clock import ManualClock
from service.frame import Frame
from service.perception_result import PerceptionResult
from service.recorder.recorder import Recorder
from service.scale_status import ScaleStatus
from service.settings import Settings
from service.telemetry import Telemetry
from uavdepth.depth.depth_map import DepthMap
from uavdepth.scan.obstacle_scan import SECTOR_COUNT, ObstacleScan, SectorState, sector_bearings_deg

WALL_NS = 1_800_000_000_000_000_000
SECOND_NS = 1_000_000_000


def record_settings(folder: Path, *overrides: str) -> Settings:
    """Records into `folder`."""
    return make_settings(
        "record.enabled=true", f"record.folder={folder}", "record.min_free_mib=0", *overrides
    )


def scan_with(obstacle_m: float = 4.0) -> ObstacleScan:
    """An obstacle straight ahead, clear beside it, unknown elsewhere."""
    distance_m = np.full(SECTOR_COUNT, np.nan, np.float32)
    state = np.full(SECTOR_COUNT, SectorState.UNKNOWN, np.uint8)
    state[25:37] = SectorState.CLEAR
    state[31], distance_m[31] = SectorState.OBSTACLE, obstacle_m
    return ObstacleScan(distance_m, state, sector_bearings_deg(), 0.3, 15.0)


def result_at(index: int, captured_ns: int, rng: np.random.Generator | None = None) -> PerceptionResult:
    """A measured picture; noise with `rng`, so that it does not compress away."""
    image = np.full((HEIGHT, WIDTH, 3), index % 256, np.uint8)
    if rng is not None:
        image = rng.integers(0, 255, (HEIGHT, WIDTH, 3), np.uint8)
    depth_m = np.full((HEIGHT, WIDTH), 4.0004, np.float32)
    depth_m[0, :4] = (np.nan, np.inf, 65.6, 65.535)
    telemetry = Telemetry(
        captured_ns, LEVEL, 2.0, (1.0, 2.0, -3.0), (0.1, 0.2, 0.3), armed=True, mode="LOITER"
    )
    return PerceptionResult(
        Frame(image, captured_ns, index),
        telemetry,
        DepthMap(depth_m, None),
        ScaleStatus(1.0, 0.1, 0.0),
        scan_with(),
    )


HEARTBEAT = Voice().heartbeat()


def record_of(folder: Path, *overrides: str, pictures: int = 12) -> Path:
    """A record of pictures at 10 Hz and a heartbeat each way between them."""
    clock = ManualClock(5 * SECOND_NS)
    recorder = Recorder(
        record_settings(folder, *overrides), clock, lambda: '{"name": "net"}', lambda: WALL_NS
    )
    for i in range(pictures):
        at_ns = clock.now_ns()
        recorder.offer_packets(HEARTBEAT, at_ns, False)
        recorder.offer_packets(HEARTBEAT, at_ns + 1, True)
        recorder.offer(result_at(i, at_ns), at_ns + 10, at_ns + 20)
        clock.advance_s(0.1)
    recorder.start()
    recorder.stop()
    return sorted(folder.glob("*.mcap"))[0]


def contents(
    path: Path,
) -> tuple[dict[str, list[Any]], dict[str, bytes], dict[str, dict[str, str]], dict[str, str]]:
    """Messages by topic, attachments, metadata, schema names by topic."""
    topics: dict[str, list[Any]] = {}
    schemas: dict[str, str] = {}
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        for schema, channel, message in reader.iter_messages():
            topics.setdefault(channel.topic, []).append(message)
            schemas[channel.topic] = schema.name if schema else ""
        attachments = {item.name: item.data for item in reader.iter_attachments()}
        metadata = {item.name: dict(item.metadata) for item in reader.iter_metadata()}
    return topics, attachments, metadata, schemas
