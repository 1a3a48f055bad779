"""Recorded flights and simulated walls for the tests of the fake autopilots."""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.fake_autopilot.controller import Controller
from service.fake_autopilot.obstacle_words import ObstacleWords
from service.fake_autopilot.vehicle import Multirotor

LOGS = Path(__file__).parents[2] / "sitl_logs"
STAMP = struct.Struct(">Q")
STEP_S = 0.005


def read_tlog(name: str, kinds: Sequence[str]) -> Iterator[tuple[int, Any]]:
    """Host microseconds and message of every packet of these kinds in a recorded telemetry log."""
    data = (LOGS / name).read_bytes()
    codec = mavlink.MAVLink(None)
    wanted = {getattr(mavlink, f"MAVLINK_MSG_ID_{kind}") for kind in kinds}
    start = 0
    while start + STAMP.size + 12 <= len(data):
        (stamp_us,) = STAMP.unpack_from(data, start)
        begin = start + STAMP.size
        signed = 13 if data[begin + 2] & mavlink.MAVLINK_IFLAG_SIGNED else 0
        start = begin + 12 + data[begin + 1] + signed
        if int.from_bytes(data[begin + 7 : begin + 10], "little") in wanted:
            yield stamp_us, codec.decode(bytearray(data[begin:start]))


def boot_clock(name: str) -> Callable[[int], float]:
    """Host microseconds to the autopilot's microseconds since boot, from a received telemetry log.

    The two clocks drift apart by 0.2 parts in a thousand. A packet cannot come before it was sent, so the
    line through the smallest delays of every ten seconds joins them to within about a millisecond.
    """
    pairs = np.array([(us, m.time_boot_ms * 1000.0) for us, m in read_tlog(name, ["ATTITUDE"])])
    origin = pairs[0, 0]
    host, boot = pairs[:, 0] - origin, pairs[:, 1]
    lead = boot - host
    tens = (host // 10e6).astype(int)
    best = np.array([np.flatnonzero(tens == ten)[np.argmax(lead[tens == ten])] for ten in np.unique(tens)])
    slope, offset = np.polyfit(host[best], boot[best], 1)
    return lambda host_us: float(slope * (host_us - origin) + offset)


@dataclass
class Wall:
    """Flat ground and an endless wall across the north axis."""

    north_m: float = 40.0

    def ground_height_m(self, north_m: float, east_m: float) -> float:
        return 0.0

    def ray_distance_m(self, origin_ned_m: Any, direction_ned: Any) -> list[float]:
        down = float(direction_ned[2])
        return [-float(origin_ned_m[2]) / down if down > 0.0 else math.inf]

    def clearance_m(self, position_ned_m: Sequence[float]) -> float:
        return max(min(-float(position_ned_m[2]), self.north_m - float(position_ned_m[0])), 0.0)


def scan_of(
    wall: Wall, vehicle: Multirotor, max_distance_cm: int = 2000, half_view_deg: float = 45.0
) -> ObstacleWords:
    """What a perfect sensor says about a wall: clear beyond its range, unknown outside its field of view."""
    words = []
    for element in range(72):
        bearing_deg = (5.0 * element - 155.0 + 180.0) % 360.0 - 180.0
        ahead = math.cos(math.radians(bearing_deg) + vehicle.yaw_rad)
        if abs(bearing_deg) > half_view_deg:
            words.append(65535)
            continue
        distance_cm = 100.0 * (wall.north_m - vehicle.north_m) / ahead if ahead > 1e-6 else math.inf
        words.append(int(min(max(distance_cm, 21), max_distance_cm + 1)))
    return ObstacleWords(words, max_distance_cm=max_distance_cm)


def one_word(bearing_deg: int, word: int, others: int = 65535, **fields: Any) -> ObstacleWords:
    """A message with one word in the element at a bearing (a multiple of 5) and another in all the rest."""
    words = [others] * 72
    words[((bearing_deg + 155) % 360) // 5] = word
    return ObstacleWords(words, **fields)


@dataclass
class Flight:
    """A controller that is stepped on, with obstacle messages at a steady rate.

    Args:
        controller: who flies.
        message: makes the next message, or None for none.
        rate_hz: how often it is asked.
    """

    controller: Controller
    message: Callable[[], ObstacleWords | None] = lambda: None
    rate_hz: float = 12.5
    next_message_s: float = 0.0

    def fly(self, seconds: float, command: Callable[[], None] = lambda: None) -> None:
        """Go on for so long, giving the command with every step."""
        for _ in range(round(seconds / STEP_S)):
            if self.controller.now_s >= self.next_message_s:
                self.next_message_s += 1.0 / self.rate_hz
                words = self.message()
                if words is not None:
                    self.controller.obstacles(words)
            command()
            self.controller.step(STEP_S)
