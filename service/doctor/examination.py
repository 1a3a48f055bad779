"""Listening to an autopilot as the service would, without sockets or a clock: bytes in, a snapshot out."""

from __future__ import annotations

from collections.abc import Hashable
from typing import Any

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.autopilot.byte_budget import bytes_per_s_of
from service.autopilot.rate_meter import RateMeter
from service.autopilot.session import LinkSession
from service.autopilot.signing import Signing, Verdict, is_signed
from service.autopilot.signing_key import SigningKey
from service.autopilot.streams import wanted_streams
from service.doctor.observation import PX4, Observation, Plan
from service.doctor.parameter_names import PARAMETERS
from service.doctor.parameter_reader import ParameterReader
from service.doctor.probe import ObstacleProbe
from service.settings.autopilot import AutopilotSettings
from uavdepth.messages.obstacle_distance import encode_obstacle_distance
from uavdepth.scan.obstacle_scan import SECTOR_COUNT, ObstacleScan, SectorState, sector_bearings_deg

_ASK_AGAIN_NS = 500_000_000
_PROBE_LIFE_NS = 50_000_000
"""A message of the trial that could not leave at once never leaves: "disarmed" would be too old."""

_QUESTION_LIFE_NS = 1_000_000_000
_MOST_SOURCES = 8
_MOST_TEXTS = 10
_DOWNWARD = mavlink.MAV_SENSOR_ROTATION_PITCH_270
_FACES = range(8)
_OBSTACLES = ("OBSTACLE_DISTANCE", "OBSTACLE_DISTANCE_3D")


class Examination:
    """A link as `run` uses it, with a second ear for what only the doctor wants to know.

    It asks: message rates as the service does, AUTOPILOT_VERSION, parameters by name. It sends empty obstacle
    messages as `ObstacleProbe` allows. It sets no parameter, mode or anything else.

    Args:
        settings: the `[autopilot]` section.
        plan: what the service means to do.
        sent_range_m: max_distance of the trial's messages; the service's own, as PX4 remembers the largest.
        key: what the link signs with, or None.
        probe: whether the trial is allowed.
    """

    def __init__(
        self,
        settings: AutopilotSettings,
        plan: Plan,
        sent_range_m: float,
        key: SigningKey | None = None,
        probe: bool = True,
    ) -> None:
        self._settings = settings
        self._empty = unknown_everywhere(plan.nearest_m, sent_range_m)
        self._session = LinkSession(settings, key)
        self._ear = None if key is None else Signing(key)
        self._codecs: dict[Hashable, Any] = {}
        self._reader: ParameterReader | None = None
        self._probe = ObstacleProbe(probe)
        self._ask_ns = 0
        self._begun_ns: int | None = None
        self._heard_ns: int | None = None
        self._line_error: str | None = None
        self._bytes = 0
        self._version: tuple[int, int, int] | None = None
        self._version_told = False
        self._signed = False
        self._range_meter = RateMeter()
        self._range_m: float | None = None
        self._echo: set[int] = set()
        self._fused_map = False
        self._other_sender = False
        self._refusals: list[str] = []

    @property
    def destination(self) -> Hashable:
        """Where to send on a line with many ends, or None."""
        return self._session.destination

    def heard_s(self, now_ns: int) -> float:
        """Seconds since the autopilot's first HEARTBEAT, 0 before."""
        return 0.0 if self._heard_ns is None else (now_ns - self._heard_ns) / 1e9

    def is_done(self, now_ns: int) -> bool:
        """Whether all parameters have answered or been given up."""
        return self._reader is not None and self._reader.is_done(now_ns)

    def line_opened(self, now_ns: int) -> None:
        """The socket or port is open."""
        self._line_error = None
        self._session.line_opened(now_ns)

    def line_failed(self, reason: str) -> None:
        """The socket or port could not be opened, or was lost."""
        self._line_error = reason
        self._session.line_failed(reason)

    def receive(self, data: bytes, arrival_ns: int, source: Hashable = None) -> None:
        """Take bytes of any quality."""
        self._bytes += len(data)
        self._session.receive(data, arrival_ns, source)
        if source not in self._codecs and len(self._codecs) >= _MOST_SOURCES:
            return
        codec = self._codecs.setdefault(source, _new_codec())
        for message in codec.parse_buffer(data) or []:
            if message.get_type() != "BAD_DATA" and self._is_believed(message):
                self._on_message(message, arrival_ns, source)

    def tick(self, now_ns: int) -> None:
        """Queue what is due; call it at least ten times a second."""
        if self._begun_ns is None:
            self._begun_ns = now_ns
        self._session.tick(now_ns)
        status = self._session.status(now_ns)
        if status.system_id is None or not status.connected:
            return
        if self._heard_ns is None:
            self._heard_ns = now_ns
        if self._reader is None:
            self._reader = ParameterReader(
                PARAMETERS.get(status.autopilot or "", ()), status.autopilot == PX4
            )
        for request in self._reader.requests(status.system_id, now_ns):
            self._session.ask(request, now_ns + _QUESTION_LIFE_NS)
        if now_ns >= self._ask_ns:
            self._ask_ns = now_ns + _ASK_AGAIN_NS
            self._ask(status.system_id, now_ns)
        if self._probe.may_send(
            status.autopilot, status.armed, status.heartbeat_age_s, self._other_sender, now_ns
        ):
            self._session.ask(encode_obstacle_distance(self._empty), now_ns + _PROBE_LIFE_NS)

    def take_output(self, now_ns: int) -> list[bytes]:
        """Frames to write now, in order."""
        return self._session.take_output(now_ns)

    def observation(self, now_ns: int) -> Observation:
        """What is known now."""
        status = self._session.status(now_ns)
        return Observation(
            endpoint=self._settings.endpoint,
            seconds=0.0 if self._begun_ns is None else (now_ns - self._begun_ns) / 1e9,
            line_error=self._line_error,
            bytes_received=self._bytes,
            bad_bytes=status.bad_bytes,
            autopilot=status.autopilot,
            version=self._version,
            system_id=status.system_id,
            profile=status.profile,
            other_system_ids=status.other_system_ids,
            mode=status.mode,
            armed=status.armed,
            mavlink1=status.mavlink1_seen,
            signed=self._signed,
            rates_hz=dict(status.rates_hz),
            rangefinder_hz=self._range_meter.per_second(now_ns),
            rangefinder_m=self._range_m,
            echo_faces=frozenset(self._echo),
            fused_map=self._fused_map,
            other_sender=self._other_sender,
            reboots=status.reboots,
            clock_steps=status.clock_steps,
            parameters=dict(self._reader.values) if self._reader else {},
            unanswered=self._reader.unanswered if self._reader else (),
            probe=self._probe.outcome,
            proximity_before=self._probe.before,
            proximity_during=self._probe.during,
            refusals=tuple(self._refusals),
            refused_packets=dict(status.refused_packets),
        )

    def _ask(self, system_id: int, now_ns: int) -> None:
        wanted = [] if self._version_told else [mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION]
        if self._probe.before is None or self._probe.wants_status(now_ns):
            wanted.append(mavlink.MAVLINK_MSG_ID_SYS_STATUS)
        for message_id in wanted:
            self._session.ask(
                mavlink.MAVLink_command_long_message(
                    system_id,
                    mavlink.MAV_COMP_ID_AUTOPILOT1,
                    mavlink.MAV_CMD_REQUEST_MESSAGE,
                    0,
                    float(message_id),
                    *[0.0] * 6,
                ),
                now_ns + _QUESTION_LIFE_NS,
            )

    def _is_believed(self, message: Any) -> bool:
        return self._ear is None or self._ear.verdict(message.get_msgbuf()) is Verdict.GOOD

    def _on_message(self, message: Any, arrival_ns: int, source: Hashable) -> None:
        status = self._session.status(arrival_ns)
        if status.system_id is None or source != self._session.destination:
            return
        name = message.get_type()
        sender = (message.get_srcSystem(), message.get_srcComponent())
        if sender != (status.system_id, mavlink.MAV_COMP_ID_AUTOPILOT1):
            self._other_sender = self._other_sender or name in _OBSTACLES
            return
        self._signed = is_signed(message.get_msgbuf())
        if name == "PARAM_VALUE" and self._reader is not None:
            self._reader.on_value(message)
        elif name == "DISTANCE_SENSOR":
            self._on_distance(message, arrival_ns)
        elif name == "OBSTACLE_DISTANCE":
            self._fused_map = True
        elif name == "SYS_STATUS":
            healthy = message.onboard_control_sensors_health & mavlink.MAV_SYS_STATUS_SENSOR_PROXIMITY
            self._probe.on_proximity(bool(healthy), arrival_ns)
        elif name == "AUTOPILOT_VERSION":
            self._on_version(message.flight_sw_version)
        elif name == "STATUSTEXT":
            self._on_text(message.text)

    def _on_distance(self, message: Any, arrival_ns: int) -> None:
        if message.orientation == _DOWNWARD:
            self._range_meter.add(arrival_ns)
            self._range_m = message.current_distance / 100.0
        elif message.orientation in _FACES:
            self._echo.add(message.orientation)

    def _on_version(self, word: int) -> None:
        self._version_told = True
        version = (word >> 24 & 0xFF, word >> 16 & 0xFF, word >> 8 & 0xFF)
        self._version = version if any(version) else None

    def _on_text(self, text: str | bytes) -> None:
        words = (text.decode("utf-8", "replace") if isinstance(text, bytes) else text).rstrip("\0")
        if words.startswith("PreArm") and words not in self._refusals and len(self._refusals) < _MOST_TEXTS:
            self._refusals.append(words)


def plan_of(
    settings: AutopilotSettings,
    nearest_m: float,
    range_m: float,
    *,
    signs: bool = False,
) -> Plan:
    """What the service means to do by its settings."""
    return Plan(
        range_m=range_m,
        nearest_m=nearest_m,
        rate_hz=settings.obstacle_rate_hz,
        system_id=settings.system_id,
        wanted_hz={stream.message: stream.rate_hz for stream in wanted_streams(settings)},
        signs=signs,
        bytes_per_s=bytes_per_s_of(settings.bytes_per_s, settings.endpoint),
        sends_3d=settings.obstacle_points,
    )


def unknown_everywhere(nearest_m: float, range_m: float) -> ObstacleScan:
    """A scan that says nothing, with the range that the service will use: PX4 remembers the largest."""
    return ObstacleScan(
        distance_m=np.full(SECTOR_COUNT, np.nan, dtype=np.float32),
        state=np.full(SECTOR_COUNT, SectorState.UNKNOWN, dtype=np.uint8),
        bearing_deg=sector_bearings_deg(),
        min_distance_m=nearest_m,
        max_distance_m=range_m,
    )


def _new_codec() -> Any:
    codec = mavlink.MAVLink(None)
    codec.robust_parsing = True
    return codec
