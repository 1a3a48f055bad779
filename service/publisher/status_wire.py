"""What a status says: versioned JSON, as in `service.publisher.wire`."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict, Field

from service.publisher.wire import Count, Message, Words


class ExtraCamera(BaseModel):
    """A further camera whose sight is added to the scan.

    Args:
        name: as configured.
        used: what it sees is in the messages.
        trouble: why it is missing, in words; None if it is not, or if nothing is sent at all.
        camera, camera_detail: its state, as of the main one.
        frames_per_s: its pictures that were measured.
        age_s: since its newest measured picture was taken; None before the first.
        latency_ms_p50, latency_ms_p95: from its capture to the wire; None before the first message.
        losses: how often it was lost since the start.
        model_failures: its pictures that the network failed on.
    """

    model_config = ConfigDict(frozen=True, extra="ignore", allow_inf_nan=False)

    name: Words
    used: bool
    trouble: Words | None = None
    camera: Words
    camera_detail: Words = ""
    frames_per_s: float
    age_s: float | None = None
    latency_ms_p50: float | None = None
    latency_ms_p95: float | None = None
    losses: Count = 0
    model_failures: Count = 0


class StatusSample(Message):
    """The service at one moment, as a ground station shows it.

    Args:
        vehicle: its name.
        state: BOOT, STANDBY, ACTIVE or CRITICAL.
        trouble: why no distances are sent, in words; None if they are.
        uptime_s: since the start of the service.
        frames_per_s: pictures that were measured.
        obstacle_messages: OBSTACLE_DISTANCE messages since the start.
        latency_ms_p50, latency_ms_p95: from capture to wire; None before the first message.
        dropped_frames, dropped_samples: values that a newer one replaced, per slot.
        model_failures: pictures that the network failed on.
        scale_factor, scale_relative_sigma, scale_age_s: metric scale of the newest picture; None if it has
            none. A network that answers in metres has the factor 1 and a sigma of its own.
        scale_sources: what told it, e.g. "ground", "points".
        scale_suspicion: what seems to be wrong with it, in words; None if nothing.
        height_m, mode, armed: of the vehicle; None if not heard.
        altitude_m: height above the origin of the autopilot's local frame (where it was started).
        speed_mps: speed over ground.
        camera, camera_detail: state of the camera.
        link_connected, autopilot, system_id: of the MAVLink link.
        link_detail: what is wrong with it, in words; empty if nothing.
        obstacle_profile: layout of OBSTACLE_DISTANCE: "ardupilot", "px4", "px4-legacy".
        obstacle_rate_hz: OBSTACLE_DISTANCE messages a second.
        link_in_bytes_per_s, link_out_bytes_per_s: of the MAVLink link.
        link_signed: its packets are signed, and only signed ones are believed.
        recording: whether a record is being written; None where no recorder is set up.
        recording_detail: what is wrong with it, in words; empty if nothing.
        stream_profile: what is sent to the ground: "full", "thin", "scan-only".
        cp_delay_s, margin_m: CP_DELAY and margin that the measured latency asks for.
        memory_mib: resident memory.
        extra_cameras: the further cameras.
    """

    vehicle: Words
    state: Words
    trouble: Words | None = None
    uptime_s: float
    frames_per_s: float
    obstacle_messages: Count
    latency_ms_p50: float | None = None
    latency_ms_p95: float | None = None
    dropped_frames: Count = 0
    dropped_samples: Count = 0
    model_failures: Count = 0
    scale_factor: float | None = None
    scale_relative_sigma: float | None = None
    scale_age_s: float | None = None
    scale_sources: tuple[Words, ...] = Field(default=(), max_length=8)
    scale_suspicion: Words | None = None
    height_m: float | None = None
    mode: Words | None = None
    armed: bool | None = None
    altitude_m: float | None = None
    speed_mps: float | None = None
    camera: Words
    camera_detail: Words = ""
    link_connected: bool
    autopilot: Words | None = None
    system_id: Count | None = None
    link_detail: Words = ""
    obstacle_profile: Words | None = None
    obstacle_rate_hz: float | None = None
    link_in_bytes_per_s: float | None = None
    link_out_bytes_per_s: float | None = None
    link_signed: bool | None = None
    recording: bool | None = None
    recording_detail: Words = ""
    stream_profile: Words | None = None
    cp_delay_s: float | None = None
    margin_m: float | None = None
    memory_mib: float
    extra_cameras: tuple[ExtraCamera, ...] = Field(default=(), max_length=8)
