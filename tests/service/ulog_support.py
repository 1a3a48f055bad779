"""A small PX4 log, written by the format's own description (docs.px4.io, ULog file format)."""

from __future__ import annotations

import math
import struct

ATTITUDE = "vehicle_attitude:uint64_t timestamp;float[4] q;"
POSITION = "vehicle_local_position:uint64_t timestamp;float x;float y;float z;float vx;float vy;float vz;"
DISTANCE = (
    "distance_sensor:uint64_t timestamp;float min_distance;float max_distance;float current_distance;"
    "uint8_t orientation;"
)
STATUS = "vehicle_status:uint64_t timestamp;uint8_t nav_state;uint8_t arming_state;"


def _message(kind: bytes, data: bytes) -> bytes:
    return struct.pack("<Hc", len(data), kind) + data


def small_ulog(seconds: float, yaw_rate_rps: float, height_m: float = 3.0) -> bytes:
    """A vehicle that yaws from north on at a steady rate, flies north at 1 m/s, in Position mode."""
    formats = (ATTITUDE, POSITION, DISTANCE, STATUS)
    log = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0)
    log += _message(b"B", bytes(40))
    for text in formats:
        log += _message(b"F", text.encode())
    for number, text in enumerate(formats):
        log += _message(b"A", struct.pack("<BH", 0, number) + text.split(":")[0].encode())
    for step in range(round(seconds * 50)):
        at_us = 5_000_000 + step * 20_000
        yaw = yaw_rate_rps * step / 50
        attitude = struct.pack("<Q4f", at_us, math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2))
        position = struct.pack("<Q6f", at_us, step / 50, 0.0, -height_m, 1.0, 0.0, 0.0)
        distance = struct.pack("<Q3fB", at_us, 0.1, 40.0, height_m, 25)
        for number, data in ((0, attitude), (1, position), (2, distance)):
            log += _message(b"D", struct.pack("<H", number) + data)
        if step % 25 == 0:
            log += _message(b"D", struct.pack("<HQBB", 3, at_us, 2, 2))
    return log
