"""PX4's logs (.ulg) as telemetry."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.errors import RecordError
from service.replay.footage import Packets
from service.replay.telemetry_writer import TelemetryWriter

_MAGIC = b"ULog\x01\x12\x35"
_HEARTBEAT_US = 1_000_000
_DOWNWARD = 25
_ARMED = 2
_TOPICS = ["vehicle_attitude", "vehicle_local_position", "distance_sensor", "vehicle_status"]
_MAIN_MODES = {0: 1, 1: 2, 2: 3, 3: 4, 4: 4, 5: 4, 15: 2, 17: 4, 18: 4}
"""PX4's nav_state to the main mode of custom_mode: manual 1, altitude 2, position 3, auto 4."""

_BROKEN = (
    ValueError,
    TypeError,
    KeyError,
    IndexError,
    AttributeError,
    struct.error,
    EOFError,
    OverflowError,
    MemoryError,
    RecursionError,
    OSError,
)


def read_ulog(path: Path) -> list[Packets]:
    """vehicle_attitude, vehicle_local_position, distance_sensor and vehicle_status as MAVLink.

    Times are nanoseconds since boot.

    Raises:
        RecordError: it cannot be read, is no ULog, or holds no attitude.
    """
    from pyulog import ULog

    try:
        with path.open("rb") as file:
            head = file.read(len(_MAGIC))
    except OSError as error:
        raise RecordError(f"{path}: cannot be read: {error.strerror}") from error
    if head != _MAGIC:
        raise RecordError(f"{path}: is no ULog (it begins with {head!r})")
    try:
        log = ULog(str(path), _TOPICS)
        topics = {data.name: data.data for data in log.data_list if data.multi_id == 0}
        writer = TelemetryWriter(mavlink.MAV_AUTOPILOT_PX4)
        _attitudes(writer, topics.get("vehicle_attitude"))
        _positions(writer, topics.get("vehicle_local_position"))
        _heights(writer, [data.data for data in log.data_list if data.name == "distance_sensor"])
        _heartbeats(writer, topics.get("vehicle_status"), topics.get("vehicle_attitude"))
    except _BROKEN as error:
        raise RecordError(f"{path}: is no ULog that can be read ({type(error).__name__}: {error})") from error
    if "vehicle_attitude" not in topics:
        raise RecordError(f"{path}: holds no vehicle_attitude: nothing can be replayed with it")
    return writer.packets()


Topic = dict[str, NDArray[Any]]


def _attitudes(writer: TelemetryWriter, topic: Topic | None) -> None:
    if topic is None:
        return
    w, x, y, z = (topic[f"q[{i}]"].astype(float) for i in range(4))
    roll = np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    pitch = np.arcsin(np.clip(2 * (w * y - z * x), -1, 1))
    yaw = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    for i, at_us in enumerate(_times(topic)):
        writer.attitude(int(at_us), (float(roll[i]), float(pitch[i]), float(yaw[i])))


def _positions(writer: TelemetryWriter, topic: Topic | None) -> None:
    if topic is None:
        return
    values = np.stack([topic[key].astype(float) for key in ("x", "y", "z", "vx", "vy", "vz")], axis=1)
    for at_us, (x, y, z, vx, vy, vz) in zip(_times(topic), values.tolist(), strict=True):
        writer.position(int(at_us), (x, y, z), (vx, vy, vz))


def _heights(writer: TelemetryWriter, topics: list[Topic]) -> None:
    for topic in topics:
        if int(topic["orientation"][0]) != _DOWNWARD:
            continue
        quality = topic.get("signal_quality")
        for i, at_us in enumerate(_times(topic)):
            metres = float(topic["current_distance"][i])
            inside = float(topic["min_distance"][i]) < metres < float(topic["max_distance"][i])
            good = quality is None or int(quality[i]) != 0
            writer.height(int(at_us), metres, valid=inside and good, max_m=float(topic["max_distance"][i]))
        return


def _heartbeats(writer: TelemetryWriter, status: Topic | None, attitude: Topic | None) -> None:
    """Once a second, whatever the log's own rate of vehicle_status."""
    if attitude is None or not len(attitude["timestamp"]):
        return
    times = attitude["timestamp"]
    for at_us in range(int(times[0]), int(times[-1]) + 1, _HEARTBEAT_US):
        mode, armed = 0, False
        if status is not None and len(status["timestamp"]):
            i = max(0, int(np.searchsorted(status["timestamp"], at_us, side="right")) - 1)
            mode = _MAIN_MODES.get(int(status["nav_state"][i]), 0) << 16
            armed = int(status["arming_state"][i]) == _ARMED
        writer.heartbeat(at_us, mode, armed=armed)


def _times(topic: Topic) -> NDArray[Any]:
    """When it was measured, where that is told; else when it was logged."""
    sample = topic.get("timestamp_sample")
    if sample is not None and bool(np.all(sample > 0)):
        return np.asarray(sample)
    return topic["timestamp"]
