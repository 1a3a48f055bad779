"""`[record]`: what is kept of a flight on the vehicle's own disk."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from service.settings.section import Section


class RecordSettings(Section):
    """What is kept of a flight on the vehicle's own disk."""

    enabled: bool = Field(
        default=False,
        title="Record",
        description="On: every flight is recorded; `uavdepth run --record DIR` does the same for one.",
    )
    folder: str = Field(
        default="recordings",
        min_length=1,
        title="Folder",
        description="Where records are written; made if it is not there. Nothing in it is overwritten.",
    )
    camera: bool = Field(
        default=True,
        title="Record the camera",
        description="Off: records cannot be replayed from their pictures.",
    )
    camera_quality: int = Field(
        default=90,
        ge=1,
        le=100,
        title="JPEG quality of the camera",
        description="1 (smallest) to 100 (best). Replays see what JPEG has left of the picture.",
    )
    depth_rate_hz: float = Field(
        default=5.0,
        ge=0.0,
        le=60.0,
        title="Depth pictures per second",
        description="Upper limit for depth in millimetres and its uncertainty, by far the largest part of a "
        "record; 0: none.",
    )
    tlog: bool = Field(
        default=True,
        title="Telemetry log beside it",
        description="MAVLink in both directions as `.tlog` too, for Mission Planner and QGroundControl.",
    )
    max_file_mib: int = Field(
        default=512,
        ge=1,
        le=65536,
        title="Largest file, MiB",
        description="A record goes on in a new file when it has grown to this size.",
    )
    max_total_mib: int = Field(
        default=8192,
        ge=2,
        le=4194304,
        title="Largest folder, MiB",
        description="What all records in the folder may take together; see `when_full`.",
    )
    when_full: Literal["delete-oldest", "stop"] = Field(
        default="delete-oldest",
        title="When the folder is full",
        description="`delete-oldest` removes the oldest records of this service, `stop` keeps them and "
        "records no more. Other files are never touched.",
    )
    min_free_mib: int = Field(
        default=256,
        ge=0,
        le=1048576,
        title="Space left on the disk, MiB",
        description="Recording pauses while the disk has less than this to spare.",
    )
    queue_mib: int = Field(
        default=64,
        ge=4,
        le=4096,
        title="Queue, MiB of memory",
        description="What may wait for a slow disk; what does not fit is dropped and counted.",
    )
