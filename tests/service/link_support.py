"""Recorded and imitated autopilots for the tests of the link."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pymavlink import DFReader
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.autopilot.session import LinkSession
from service.settings.autopilot import AutopilotSettings
from uavdepth.scan.obstacle_scan import ObstacleScan, SectorState, sector_bearings_deg

LOGS = Path(__file__).resolve().parents[2] / "sitl_logs"
SECOND_NS = 1_000_000_000
TICK_NS = 20_000_000


@dataclass(frozen=True)
class Arrival:
    """Bytes and when they came, nanoseconds of the recording host's clock."""

    at_ns: int
    data: bytes


def read_tlog(name: str) -> list[Arrival]:
    """The frames of a recording: 8 bytes of big-endian microseconds before each MAVLink 2 frame."""
    data = (LOGS / name).read_bytes()
    arrivals, i = [], 0
    while i + 11 <= len(data):
        at_ns = int.from_bytes(data[i : i + 8], "big") * 1000
        length = data[i + 9] + (25 if data[i + 10] & 1 else 12)
        arrivals.append(Arrival(at_ns, data[i + 8 : i + 8 + length]))
        i += 8 + length
    return arrivals


def message_id(frame: bytes) -> int:
    return int.from_bytes(frame[7:10], "little")


def decoded(frames: Iterable[bytes]) -> list[mavlink.MAVLink_message]:
    """Messages of whole frames."""
    codec = mavlink.MAVLink(None)
    return [codec.decode(bytearray(frame)) for frame in frames]


def attitude_stamps(arrivals: Iterable[Arrival]) -> NDArray[np.int64]:
    """(N, 2) arrival and boot time of each ATTITUDE, nanoseconds."""
    found = [a for a in arrivals if message_id(a.data) == mavlink.MAVLINK_MSG_ID_ATTITUDE]
    messages = decoded(a.data for a in found)
    return np.array([(a.at_ns, m.time_boot_ms * 1_000_000) for a, m in zip(found, messages, strict=True)])


class TrueOffset:
    """Host clock minus autopilot clock, known afterwards: nothing arrives before it was stamped, so within
    each two seconds the offset is that of the ATTITUDE that was held up the least."""

    def __init__(self, arrivals: Iterable[Arrival]) -> None:
        stamps = attitude_stamps(arrivals)
        delay = stamps[:, 0] - stamps[:, 1]
        piece = (stamps[:, 0] - stamps[0, 0]) // (2 * SECOND_NS)
        pieces = np.unique(piece)
        self._boot_ns = np.array([stamps[piece == p, 1].mean() for p in pieces])
        self._least_ns = delay.min()
        self._offset_ns = np.array([delay[piece == p].min() - self._least_ns for p in pieces])

    def host_ns(self, boot_ns: float) -> int:
        """The host's time at a moment of the autopilot's clock."""
        return round(boot_ns) + self._at(boot_ns)

    def boot_ns(self, host_ns: int) -> int:
        """The autopilot's time at a moment of the host's clock."""
        return host_ns - self._at(host_ns - int(self._least_ns))

    def _at(self, boot_ns: float) -> int:
        return int(self._least_ns) + round(float(np.interp(boot_ns, self._boot_ns, self._offset_ns)))


def dataflash_rows(name: str, *types: str) -> dict[str, NDArray[np.float64]]:
    """(N, 4) rows of a dataflash log by type: microseconds since boot; roll, pitch, yaw in degrees."""
    log = DFReader.DFReader_binary(str(LOGS / name))
    rows: dict[str, list[tuple[float, ...]]] = {kind: [] for kind in types}
    while (row := log.recv_match(type=list(types))) is not None:
        rows[row.get_type()].append((row.TimeUS, row.Roll, row.Pitch, row.Yaw))
    return {kind: np.array(found) for kind, found in rows.items()}


class Conversation:
    """A session, ticked every 20 ms of a clock that the test moves, and what it sends."""

    def __init__(self, start_ns: int, **settings: object) -> None:
        self.session = LinkSession(AutopilotSettings.model_validate(settings))
        self.now_ns = start_ns
        self._next_tick_ns = start_ns + TICK_NS
        self.sent: list[tuple[int, mavlink.MAVLink_message]] = []
        self.notices: list[str] = []
        self.session.line_opened(start_ns)
        self._tick()

    def _tick(self) -> None:
        self.session.tick(self.now_ns)
        self.sent += [(self.now_ns, m) for m in decoded(self.session.take_output(self.now_ns))]
        self.notices += [notice.text for notice in self.session.take_notices()]

    def wait_until(self, at_ns: int) -> None:
        """Let time pass."""
        while self._next_tick_ns <= at_ns:
            self.now_ns = self._next_tick_ns
            self._next_tick_ns += TICK_NS
            self._tick()
        self.now_ns = max(self.now_ns, at_ns)

    def wait_s(self, seconds: float) -> None:
        self.wait_until(self.now_ns + round(seconds * 1e9))

    def hear(self, data: bytes, at_ns: int | None = None, source: Hashable = None) -> None:
        """Let bytes arrive, at `at_ns` or now."""
        if at_ns is not None:
            self.wait_until(at_ns)
        self.session.receive(data, self.now_ns if at_ns is None else at_ns, source)

    def sent_of(self, name: str, since_ns: int = 0) -> list[tuple[int, mavlink.MAVLink_message]]:
        return [(at, m) for at, m in self.sent if m.get_type() == name and at >= since_ns]


class Voice:
    """Packs an imitated sender's messages."""

    def __init__(self, system_id: int = 1, component_id: int = 1) -> None:
        self._codec = mavlink.MAVLink(None, srcSystem=system_id, srcComponent=component_id)

    def pack(self, message: mavlink.MAVLink_message, mavlink1: bool = False) -> bytes:
        frame = bytes(message.pack(self._codec, force_mavlink1=mavlink1))
        self._codec.seq = (self._codec.seq + 1) % 256
        return frame

    def heartbeat(
        self,
        kind: int = mavlink.MAV_TYPE_QUADROTOR,
        autopilot: int = mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA,
        base_mode: int = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED,
        custom_mode: int = 5,
        mavlink1: bool = False,
    ) -> bytes:
        return self.pack(
            mavlink.MAVLink_heartbeat_message(kind, autopilot, base_mode, custom_mode, 4, 3), mavlink1
        )

    def attitude(
        self, boot_ms: int, roll: float = 0.0, pitch: float = 0.0, yaw: float = 0.0, yaw_rate: float = 0.0
    ) -> bytes:
        return self.pack(
            mavlink.MAVLink_attitude_message(boot_ms % 2**32, roll, pitch, yaw, 0.0, 0.0, yaw_rate)
        )

    def position(
        self, boot_ms: int, ned: tuple[float, float, float], velocity: tuple[float, float, float]
    ) -> bytes:
        return self.pack(mavlink.MAVLink_local_position_ned_message(boot_ms % 2**32, *ned, *velocity))

    def distance(
        self, boot_ms: int, centimetres: int, orientation: int = 25, sensor_id: int = 0, quality: int = 0
    ) -> bytes:
        return self.pack(
            mavlink.MAVLink_distance_sensor_message(
                boot_ms % 2**32,
                20,
                5000,
                centimetres,
                4,
                sensor_id,
                orientation,
                0,
                0.0,
                0.0,
                (0.0,) * 4,
                quality,
            )
        )


class Flight:
    """An imitated autopilot that streams while time passes: ATTITUDE 50 Hz, position 25 Hz, HEARTBEAT 1 Hz.

    Args:
        offset_ms: the autopilot's clock at time 0 of the test's clock.
        delay_ms: how long each message is under way.
    """

    def __init__(self, talk: Conversation, voice: Voice, offset_ms: int = 10_000, delay_ms: int = 2) -> None:
        self.talk, self.voice, self.offset_ms, self.delay_ms = talk, voice, offset_ms, delay_ms
        self.yaw_rate = 0.0

    def boot_ms(self, at_ns: int) -> int:
        return at_ns // 1_000_000 + self.offset_ms

    def fly(self, seconds: float) -> None:
        """Stream for `seconds`."""
        for at_ns, frame in self.frames(seconds):
            self.talk.hear(frame, at_ns + self.delay_ms * 1_000_000)

    def frames(self, seconds: float) -> Iterator[tuple[int, bytes]]:
        """(time stamped, frame) of the next seconds."""
        start_ms = self.talk.now_ns // 1_000_000
        for step in range(round(seconds * 50)):
            at_ms = start_ms + step * 20
            boot_ms = at_ms + self.offset_ms
            if step % 50 == 0:
                yield at_ms * 1_000_000, self.voice.heartbeat()
            yaw = self.yaw_rate * boot_ms / 1000
            frame = self.voice.attitude(
                boot_ms, yaw=float(np.angle(np.exp(1j * yaw))), yaw_rate=self.yaw_rate
            )
            yield at_ms * 1_000_000, frame
            if step % 2 == 0:
                north = boot_ms / 1000.0
                yield at_ms * 1_000_000, self.voice.position(boot_ms, (north, 2.0, -5.0), (1.0, 0.0, 0.0))


def clear_scan() -> ObstacleScan:
    """Every direction clear."""
    return ObstacleScan(
        distance_m=np.full(72, np.nan, np.float32),
        state=np.full(72, SectorState.CLEAR, np.uint8),
        bearing_deg=sector_bearings_deg(),
        min_distance_m=0.2,
        max_distance_m=20.0,
    )
