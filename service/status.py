"""The service at one moment: what `status`, the ground station and the log show."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

from service.autopilot.link_status import LinkStatus
from service.autopilot.service_state import ServiceState
from service.cameras.reader import CameraStatus
from service.latency_advice import Latency, LatencyAdvice
from service.publisher.publisher import PublisherStatus
from service.scale_status import ScaleStatus
from service.telemetry import Telemetry
from service.trouble import Trouble

_MIB = 1024 * 1024


@dataclass(frozen=True)
class Drops:
    """Values that a newer one replaced before they were used, per slot.

    Args:
        frames: pictures that the network had no time for.
        samples: results that the Zenoh publisher had no time for.
    """

    frames: int
    samples: int


@dataclass(frozen=True)
class SideStatus:
    """One of `[[extra_camera]]` at one moment.

    Args:
        name: as configured.
        used: what it sees is in the messages; in none while nothing is sent.
        trouble: why it is missing; None if it is not, or if the service's own trouble silences all.
        camera: what it does.
        frames_per_s: its pictures measured, over the last seconds.
        age_s: since its newest measured picture was taken; None before the first.
        latency: from its capture until a message told of it, which is one of the main camera's; None before
            the first.
        losses: how often it was lost since the start.
        model_failures: its pictures that the network failed on.
    """

    name: str
    used: bool
    trouble: Trouble | None
    camera: CameraStatus
    frames_per_s: float
    age_s: float | None
    latency: Latency | None
    losses: int
    model_failures: int


@dataclass(frozen=True)
class ServiceStatus:
    """The service at one moment.

    Args:
        vehicle: its name.
        uptime_s: since the start, seconds.
        state: as in the HEARTBEAT.
        trouble: why no distances are sent, None if they are.
        frames: pictures measured since the start.
        frames_per_s: the same over the last seconds.
        step_ms: mean time of one measurement, milliseconds; None before the first.
        obstacle_messages: OBSTACLE_DISTANCE messages since the start.
        obstacle_rate_hz: the same over the last seconds.
        latency: from capture to wire; None before the first message.
        drops: what was skipped.
        model_failures: pictures that the network failed on.
        scale: metric scale of the newest picture; None if it has none.
        height_m, mode, armed: the vehicle's; None if not heard.
        camera: the camera.
        link: the MAVLink link.
        publisher: Zenoh; None if switched off.
        memory_mib: resident memory, 0 where the system does not tell.
        altitude_m: height above the origin of the autopilot's local frame; None if not heard.
        speed_mps: speed over ground; None if not heard.
        recording: whether a record is being written; None where no recorder is set up.
        recording_detail: what is wrong with the record, in words; empty if nothing.
        advice: what the slowest camera's latency asks of the autopilot's parameters; None if not known.
        sides: the further cameras.
    """

    vehicle: str
    uptime_s: float
    state: ServiceState
    trouble: Trouble | None
    frames: int
    frames_per_s: float
    step_ms: float | None
    obstacle_messages: int
    obstacle_rate_hz: float
    latency: Latency | None
    drops: Drops
    model_failures: int
    scale: ScaleStatus | None
    height_m: float | None
    mode: str | None
    armed: bool | None
    camera: CameraStatus
    link: LinkStatus
    publisher: PublisherStatus | None
    memory_mib: float
    altitude_m: float | None = None
    speed_mps: float | None = None
    recording: bool | None = None
    recording_detail: str = ""
    advice: LatencyAdvice | None = None
    sides: tuple[SideStatus, ...] = ()


def altitude_m(telemetry: Telemetry) -> float | None:
    """Height above the origin of the autopilot's local frame, metres; None if not heard."""
    return None if telemetry.position_ned_m is None else -telemetry.position_ned_m[2]


def speed_mps(telemetry: Telemetry) -> float | None:
    """Speed over ground, metres per second; None if not heard."""
    velocity = telemetry.velocity_ned_mps
    return None if velocity is None else math.hypot(velocity[0], velocity[1])


def resident_memory_mib() -> float:
    """Resident memory of this process in MiB, 0 where the system has no /proc."""
    try:
        pages = int(Path("/proc/self/statm").read_text().split()[1])
    except (OSError, ValueError, IndexError):
        return 0.0
    import resource

    return pages * resource.getpagesize() / _MIB
