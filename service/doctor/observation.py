"""What was seen and heard of an autopilot, and what the service means to do with it: all that checks need."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum

ARDUPILOT, PX4 = "ardupilot", "px4"


class Probe(StrEnum):
    """What became of the trial with empty OBSTACLE_DISTANCE messages.

    They are sent to a disarmed ArduPilot only: in the air an "unknown" is a free way to ArduPilot, and PX4
    answers nothing from which the doctor could learn.
    """

    SENT = "sent"
    UNWANTED = "unwanted"
    ARMED = "armed"
    OTHER_SENDER = "other sender"
    NO_ANSWER_EXPECTED = "no answer expected"
    NO_TIME = "no time"


@dataclass(frozen=True)
class Plan:
    """What the service means to do, by its configuration.

    Args:
        range_m: farthest distance that it sends.
        nearest_m: nearest distance that it sends.
        rate_hz: OBSTACLE_DISTANCE messages a second.
        system_id: the only vehicle that it listens to, or 0 for the first one.
        wanted_hz: message name to the rate that it asks the autopilot for.
        latency_s: time from capture to wire that 19 of 20 messages keep, or None if it is not known.
        latency_source: who told it, or why nobody did, in words.
        signs: it signs its messages.
        bytes_per_s: what the line may carry; 0 for no limit.
        sends_3d: an ArduPilot gets OBSTACLE_DISTANCE_3D instead.
    """

    range_m: float = 20.0
    nearest_m: float = 0.2
    rate_hz: float = 15.0
    system_id: int = 0
    wanted_hz: Mapping[str, float] = field(default_factory=dict)
    latency_s: float | None = None
    latency_source: str = "not given"
    signs: bool = False
    bytes_per_s: int = 0
    sends_3d: bool = False


@dataclass(frozen=True)
class Observation:
    """A snapshot after some seconds of listening.

    Args:
        endpoint: where the autopilot was looked for, as in the configuration.
        seconds: how long was listened.
        line_error: why the line could not be opened or was lost, or None.
        bytes_received, bad_bytes: all of them, and those that belonged to no MAVLink frame.
        autopilot: "ardupilot", "px4", ...; None if no autopilot's HEARTBEAT came.
        version: (major, minor, patch) by AUTOPILOT_VERSION, None if not told or 0.0.0.
        system_id: the autopilot's, or None.
        profile: layout of OBSTACLE_DISTANCE that the service chose, or None.
        other_system_ids: autopilots that were heard and not listened to.
        mode, armed: by the newest HEARTBEAT, or None.
        mavlink1: the autopilot speaks MAVLink 1.
        signed: its frames are signed.
        rates_hz: messages a second by name, over the last two seconds.
        rangefinder_hz: DISTANCE_SENSOR with orientation 25 (downward) alone, a second.
        rangefinder_m: its newest distance in metres, or None.
        echo_faces: orientations 0 to 7 that came back as DISTANCE_SENSOR: obstacles that ArduPilot sees.
        fused_map: PX4's own OBSTACLE_DISTANCE came: Collision Prevention runs.
        other_sender: OBSTACLE_DISTANCE of somebody else, passed on by the autopilot.
        reboots, clock_steps: of the autopilot while it was watched.
        parameters: name to value, of those that answered.
        unanswered: parameters that did not, though asked several times.
        probe: what became of the trial.
        proximity_before, proximity_during: proximity bit of SYS_STATUS without and with the trial's messages.
        refusals: "PreArm: ..." texts of the autopilot.
        refused_packets: packets that were not believed, by what was wrong with their signature.
    """

    endpoint: str
    seconds: float = 8.0
    line_error: str | None = None
    bytes_received: int = 0
    bad_bytes: int = 0
    autopilot: str | None = None
    version: tuple[int, int, int] | None = None
    system_id: int | None = None
    profile: str | None = None
    other_system_ids: tuple[int, ...] = ()
    mode: str | None = None
    armed: bool | None = None
    mavlink1: bool = False
    signed: bool = False
    rates_hz: Mapping[str, float] = field(default_factory=dict)
    rangefinder_hz: float = 0.0
    rangefinder_m: float | None = None
    echo_faces: frozenset[int] = frozenset()
    fused_map: bool = False
    other_sender: bool = False
    reboots: int = 0
    clock_steps: int = 0
    parameters: Mapping[str, float] = field(default_factory=dict)
    unanswered: tuple[str, ...] = ()
    probe: Probe = Probe.UNWANTED
    proximity_before: bool | None = None
    proximity_during: bool | None = None
    refusals: tuple[str, ...] = ()
    refused_packets: Mapping[str, int] = field(default_factory=dict)
