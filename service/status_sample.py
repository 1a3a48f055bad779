"""The service's status as the ground station gets it."""

from __future__ import annotations

from service.publisher.status_wire import ExtraCamera, StatusSample
from service.status import ServiceStatus, SideStatus


def status_sample(status: ServiceStatus) -> StatusSample:
    """The wire's form of `status`."""
    latency, scale, link = status.latency, status.scale, status.link
    return StatusSample(
        vehicle=status.vehicle,
        state=status.state.name,
        trouble=None if status.trouble is None else status.trouble.value,
        uptime_s=status.uptime_s,
        frames_per_s=status.frames_per_s,
        obstacle_messages=status.obstacle_messages,
        latency_ms_p50=None if latency is None else latency.p50_ms,
        latency_ms_p95=None if latency is None else latency.p95_ms,
        dropped_frames=status.drops.frames,
        dropped_samples=status.drops.samples,
        model_failures=status.model_failures,
        scale_factor=None if scale is None else scale.factor,
        scale_relative_sigma=None if scale is None else scale.relative_sigma,
        scale_age_s=None if scale is None else scale.age_s,
        scale_sources=() if scale is None else scale.sources,
        scale_suspicion=None if scale is None else scale.suspicion,
        height_m=status.height_m,
        mode=status.mode,
        armed=status.armed,
        altitude_m=status.altitude_m,
        speed_mps=status.speed_mps,
        camera=status.camera.state.value,
        camera_detail=status.camera.detail,
        link_connected=link.connected,
        autopilot=link.autopilot,
        system_id=link.system_id,
        link_detail=link.problem or "",
        obstacle_profile=link.profile,
        obstacle_rate_hz=status.obstacle_rate_hz,
        link_in_bytes_per_s=link.bytes_in_per_s,
        link_out_bytes_per_s=link.bytes_out_per_s,
        link_signed=link.signed,
        recording=status.recording,
        recording_detail=status.recording_detail,
        stream_profile=None if status.publisher is None else status.publisher.profile,
        cp_delay_s=None if status.advice is None else status.advice.cp_delay_s,
        margin_m=None if status.advice is None else status.advice.margin_m,
        memory_mib=status.memory_mib,
        extra_cameras=tuple(_side_sample(side) for side in status.sides),
    )


def _side_sample(side: SideStatus) -> ExtraCamera:
    latency = side.latency
    return ExtraCamera(
        name=side.name,
        used=side.used,
        trouble=None if side.trouble is None else side.trouble.value,
        camera=side.camera.state.value,
        camera_detail=side.camera.detail,
        frames_per_s=side.frames_per_s,
        age_s=side.age_s,
        latency_ms_p50=None if latency is None else latency.p50_ms,
        latency_ms_p95=None if latency is None else latency.p95_ms,
        losses=side.losses,
        model_failures=side.model_failures,
    )
