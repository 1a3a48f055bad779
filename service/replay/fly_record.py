"""Regression flights: the true paths of simulated flights through rendered worlds, as records."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.autopilot.framing import MESSAGE_IDS
from service.errors import RecordError
from service.recorder import messages
from service.recorder.camera_channels import recorded_cameras
from service.recorder.perception_note import PerceptionNote, TelemetryNote
from service.recorder.record_writer import RecordHeader, RecordWriter
from service.replay.flight_plans import FlightPlan
from service.replay.flown_log import FlownLog, Truth, decoded
from service.replay.footage import Packets
from service.replay.replayed_link import ReplayedLink
from service.settings import Settings
from uavdepth.attitude import Attitude
from uavdepth.rotation import rotation_zyx

if TYPE_CHECKING:
    from uavdepth.scenes import Scene

CONFIGURATION: dict[str, dict[str, Any]] = {
    "vehicle": {"name": "sitl"},
    "camera": {"source": "sim:city", "width": 384, "height": 192, "horizontal_fov_deg": 90.0},
    "mount": {"pitch_deg": -10.0},
    # One kind of arithmetic, so that golden scans made on one machine hold on others.
    "model": {"provider": "cpu", "threads": 1},
}
"""What the flights are recorded and replayed with; every other key at this version's default."""

_JPEG_QUALITY = 88
_BEFORE_NS = 2_000_000_000
"""Telemetry from before the first picture, so that the link is up when it comes."""
_BEGUN_NS, _DONE_NS = 10_000_000, 90_000_000
"""A picture is measured from so long to so long after its exposure, as on a small computer."""
_DOWNWARD = mavlink.MAV_SENSOR_ROTATION_PITCH_270
_WALL_OFFSET_NS = 1_763_800_000_000_000_000


@dataclass(frozen=True, eq=False)
class _Ground:
    """Where a log's path lies in the world.

    Args:
        first_m: (3,) the path's first position in the log.
        start_m: (3,) the same in the world, NED.
        turn_rad: turned by, about it.
    """

    first_m: NDArray[np.float64]
    start_m: NDArray[np.float64]
    turn_rad: float

    def place(self, position_m: NDArray[np.float64]) -> NDArray[np.float64]:
        """A position of the log, in the world."""
        return self.start_m + self.turn(position_m - self.first_m)

    def turn(self, vector: NDArray[np.float64]) -> NDArray[np.float64]:
        """A direction of the log, in the world."""
        return np.asarray(rotation_zyx(0.0, 0.0, self.turn_rad) @ vector)

    def attitude(self, attitude: Attitude) -> Attitude:
        """An attitude of the log, in the world."""
        yaw_rad = math.remainder(attitude.yaw_rad + self.turn_rad, 2 * math.pi)
        return Attitude(attitude.roll_rad, attitude.pitch_rad, yaw_rad)


def fly_record(plan: FlightPlan, logs: Path, output: Path, *, force: bool = False) -> Path:
    """Make one regression flight.

    Args:
        plan: which.
        logs: folder of the simulator's logs.
        output: folder of the record.
        force: replace a record that is there.

    Returns:
        The record.

    Raises:
        RecordError: logs that are missing, or a record that is there.
        SceneError: this installation cannot render.
    """
    from uavdepth.scenes import load_scene, parse_scene

    path = output / f"{plan.name}.mcap"
    if path.exists() and not force:
        raise RecordError(f"{path}: exists; --force replaces it")
    log = FlownLog(logs / f"{plan.log}.tlog", [logs / f"{name}.BIN" for name in plan.boots])
    scene = load_scene(*parse_scene(plan.scene))
    configuration = {**CONFIGURATION, "camera": {**CONFIGURATION["camera"], "source": f"sim:{plan.scene}"}}
    settings = Settings.model_validate(configuration)
    zero_ns = log.packets[0].at_ns
    begin_ns = zero_ns + round(plan.start_s * 1e9)
    end_ns = begin_ns + round(plan.seconds * 1e9)
    ground = _ground(plan, scene, log.truth(begin_ns))
    packets = list(_said(log, scene, ground, begin_ns - _BEFORE_NS, end_ns + _DONE_NS, zero_ns))
    header = RecordHeader(plan.name, version("uavdepth"), _WALL_OFFSET_NS, configuration)
    output.mkdir(parents=True, exist_ok=True)
    unfinished = output / f".{plan.name}.unfinished"
    unfinished.unlink(missing_ok=True)
    writer = RecordWriter(unfinished, header, recorded_cameras(settings))
    try:
        _write(writer, plan, settings, log, scene, ground, packets, (begin_ns, end_ns, zero_ns))
        writer.close()
        unfinished.replace(path)
    finally:
        writer.abandon()
        unfinished.unlink(missing_ok=True)
    return path


def _write(
    writer: RecordWriter,
    plan: FlightPlan,
    settings: Settings,
    log: FlownLog,
    scene: Scene,
    ground: _Ground,
    packets: list[Packets],
    times_ns: tuple[int, int, int],
) -> None:
    begin_ns, end_ns, zero_ns = times_ns
    camera, mount = settings.camera.model, settings.mount.mount
    link = ReplayedLink(settings.autopilot, packets)
    written = 0
    for index in range(round(plan.seconds * plan.fps)):
        host_ns = begin_ns + round(index * 1e9 / plan.fps)
        if host_ns >= end_ns:
            break
        captured_ns = host_ns - zero_ns
        truth = log.truth(host_ns)
        place, attitude = ground.place(truth.position_ned_m), ground.attitude(truth.attitude)
        image = scene.render(camera, mount, place.tolist(), attitude).image_bgr
        done_ns = captured_ns + _DONE_NS
        while written < len(packets) and packets[written].at_ns <= done_ns:
            writer.packets(packets[written].data, packets[written].at_ns, outgoing=False)
            written += 1
        link.hear_until(done_ns)
        note = PerceptionNote(
            index=index,
            captured_ns=captured_ns,
            begun_ns=captured_ns + _BEGUN_NS,
            done_ns=done_ns,
            telemetry=TelemetryNote.of(link.telemetry_at(captured_ns)),
        )
        writer.note(note)
        wall_ns = captured_ns + _WALL_OFFSET_NS
        writer.image(messages.compressed_image(image, _JPEG_QUALITY, wall_ns), captured_ns)
    for packet in packets[written:]:
        writer.packets(packet.data, packet.at_ns, outgoing=False)


def _ground(plan: FlightPlan, scene: Scene, first: Truth) -> _Ground:
    down_m = -scene.ground_height_m(plan.north_m, plan.east_m) - plan.height_m
    start_m = np.array([plan.north_m, plan.east_m, down_m])
    return _Ground(first.position_ned_m, start_m, math.radians(plan.turn_deg))


def _said(
    log: FlownLog, scene: Scene, ground: _Ground, begin_ns: int, end_ns: int, zero_ns: int
) -> Iterator[Packets]:
    """What the autopilot said, as it would have said it in the world."""
    codec = mavlink.MAVLink(None)
    for packet in log.packets:
        if not begin_ns <= packet.at_ns <= end_ns:
            continue
        if int.from_bytes(packet.data[7:10], "little") not in MESSAGE_IDS:
            continue
        message = decoded(packet)
        if message is None or message.get_type() == "TIMESYNC":
            continue  # answers to questions that nobody asks here
        if message.get_type() == "DISTANCE_SENSOR":
            if message.orientation != _DOWNWARD:
                continue
            truth = log.truth_at_boot(packet.at_ns, message.time_boot_ms)
            message.current_distance = _range_cm(scene, ground, truth, message.max_distance)
        elif message.get_type() == "ATTITUDE":
            message.yaw = math.remainder(message.yaw + ground.turn_rad, 2 * math.pi)
        elif message.get_type() == "LOCAL_POSITION_NED":
            place = ground.place(np.array([message.x, message.y, message.z]))
            message.x, message.y, message.z = place.tolist()
            velocity = ground.turn(np.array([message.vx, message.vy, message.vz]))
            message.vx, message.vy, message.vz = velocity.tolist()
        codec.srcSystem, codec.srcComponent = message.get_srcSystem(), message.get_srcComponent()
        codec.seq = message.get_seq()
        yield Packets(packet.at_ns - zero_ns, bytes(message.pack(codec)))


def _range_cm(scene: Scene, ground: _Ground, truth: Truth, max_cm: int) -> int:
    """What the downward rangefinder measures in the world; beyond its reach one more than that."""
    down = ground.attitude(truth.attitude).ned_from_body @ np.array([0.0, 0.0, 1.0])
    metres = float(scene.ray_distance_m(ground.place(truth.position_ned_m), down)[0])
    return min(round(metres * 100), max_cm + 1) if math.isfinite(metres) else max_cm + 1
