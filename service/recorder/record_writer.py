"""One MCAP file."""

from __future__ import annotations

import json
import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import foxglove
from foxglove import Channel, Context, Schema
from foxglove.channels import (
    FrameTransformsChannel,
    LaserScanChannel,
    PointCloudChannel,
    PoseInFrameChannel,
)
from foxglove.mcap import MCAPCompression, MCAPWriteOptions
from foxglove.messages import CompressedImage, RawImage

from service.errors import RecordError
from service.recorder import layout, messages
from service.recorder.camera_channels import CameraChannels, RecordedCamera
from service.recorder.disk_file import DiskFile
from service.recorder.perception_note import PerceptionNote

# A full disk is told by the recorder, once, in its own words.
logging.getLogger("foxglove").setLevel(logging.CRITICAL)

_COMPRESSION_LEVEL = 1
MAX_SENDERS = 8
"""Senders on one line whose bytes are kept apart."""


@dataclass(frozen=True)
class RecordHeader:
    """What a record begins with.

    Args:
        vehicle: its name.
        version: of the program that writes.
        wall_offset_ns: wall clock minus the service's clock; log times are wall clock by this constant,
            so that a step of the wall clock does not tear the record.
        part: number of the file, from 1.
        configuration: sections of the configuration, for replays.
        model_card: the network's card as JSON text, if known.
    """

    vehicle: str
    version: str
    wall_offset_ns: int
    configuration: Mapping[str, Any]
    part: int = 1
    model_card: str | None = None

    def metadata(self) -> dict[str, str]:
        """As MCAP metadata."""
        return {
            "format": str(layout.FORMAT),
            "version": self.version,
            "vehicle": self.vehicle,
            "wall_offset_ns": str(self.wall_offset_ns),
            "part": str(self.part),
        }


class RecordWriter:
    """Writes one record. One thread.

    Args:
        path: the new file; nothing is overwritten.
        header: what it begins with.
        cameras: whose pictures these are, the main one among them.

    Raises:
        OSError: the file exists or cannot be made.
        RecordError: as below.
    """

    def __init__(self, path: Path, header: RecordHeader, cameras: Sequence[RecordedCamera]) -> None:
        self._file = DiskFile(path)
        self._offset_ns = header.wall_offset_ns
        self._mounts = {camera.name: camera.mount for camera in cameras}
        self._context = context = Context()
        self._cameras = {camera.name: CameraChannels(camera, context) for camera in cameras}
        self._scan = LaserScanChannel(layout.SCAN_TOPIC, context=context)
        self._points = PointCloudChannel(layout.POINTS_TOPIC, context=context)
        self._pose = PoseInFrameChannel(layout.POSE_TOPIC, context=context)
        self._frames = FrameTransformsChannel(layout.FRAMES_TOPIC, context=context)
        self._status = Channel(layout.STATUS_TOPIC, message_encoding="json", context=context)
        self._packets: dict[str, Channel] = {}
        try:
            self._writer = foxglove.open_mcap(
                self._file,  # type: ignore[arg-type]  # write, seek and flush are what it needs
                context=context,
                writer_options=MCAPWriteOptions(
                    compression=MCAPCompression.Zstd,
                    compression_level=_COMPRESSION_LEVEL,
                    compression_threads=0,
                    chunk_size=layout.CHUNK_BYTES,
                    profile=layout.PROFILE,
                    calculate_data_section_crc=False,
                ),
            )
            self._begin(header)
        except RuntimeError as error:
            self._file.close()
            raise self._failure(error) from error

    def _begin(self, header: RecordHeader) -> None:
        self._writer.write_metadata(layout.METADATA, header.metadata())
        self.attach(layout.CONFIGURATION, json.dumps(header.configuration).encode())
        if header.model_card is not None:
            self.attach(layout.MODEL_CARD, header.model_card.encode())

    @property
    def path(self) -> Path:
        """Where the file lies."""
        return self._file.path

    @property
    def size(self) -> int:
        """Bytes so far."""
        return self._file.size

    def attach(self, name: str, data: bytes) -> None:
        """Add a JSON document."""
        self._writer.attach(log_time=0, create_time=0, name=name, media_type="application/json", data=data)

    def note(self, note: PerceptionNote, camera: str = "") -> None:
        """Write what became of a picture; it comes before the picture itself.

        Of the main camera, whose scan holds what all of them see, it is drawn for the viewers too.
        """
        wall_ns = note.captured_ns + self._offset_ns
        self._cameras[camera].note(note, wall_ns)
        if not camera:
            self._draw(note, wall_ns)
        self._check()

    def _draw(self, note: PerceptionNote, wall_ns: int) -> None:
        telemetry = note.telemetry.telemetry(note.captured_ns)
        transforms = messages.frame_transforms(telemetry, self._mounts, wall_ns)
        self._frames.log(transforms, log_time=wall_ns)
        pose = messages.vehicle_pose(telemetry, wall_ns)
        if pose is not None:
            self._pose.log(pose, log_time=wall_ns)
        if note.scan is not None:
            scan = note.scan.scan()
            self._scan.log(messages.laser_scan(scan, wall_ns), log_time=wall_ns)
            self._points.log(messages.scan_points(scan, wall_ns), log_time=wall_ns)

    def image(self, image: CompressedImage, captured_ns: int, camera: str = "") -> None:
        """Write the picture of the note before."""
        self._cameras[camera].image(image, captured_ns + self._offset_ns)
        self._check()

    def depth(self, depth: RawImage, captured_ns: int, camera: str = "") -> None:
        """Write the depth of the note before."""
        self._cameras[camera].depth(depth, captured_ns + self._offset_ns)
        self._check()

    def sigma(self, sigma: RawImage, captured_ns: int, camera: str = "") -> None:
        """Write the uncertainty of the depth before."""
        self._cameras[camera].sigma(sigma, captured_ns + self._offset_ns)
        self._check()

    def packets(self, data: bytes, at_ns: int, *, outgoing: bool, sender: int = 0) -> None:
        """Write bytes of the MAVLink line.

        Args:
            data: as they came or went.
            at_ns: when, on the service's clock.
            outgoing: they went to the autopilot.
            sender: whose they are, on a line with many ends, 0 to `MAX_SENDERS` - 1.
        """
        topic = layout.MAVLINK_OUT_TOPIC if outgoing else layout.MAVLINK_IN_TOPIC
        if not outgoing and sender > 0:
            topic = f"{topic}/{sender + 1}"
        channel = self._packets.get(topic)
        if channel is None:
            raw = Schema(name="", encoding="", data=b"")
            channel = Channel(
                topic, message_encoding=layout.MAVLINK_ENCODING, schema=raw, context=self._context
            )
            self._packets[topic] = channel
        channel.log(data, log_time=at_ns + self._offset_ns)
        self._check()

    def status(self, text: bytes, at_ns: int) -> None:
        """Write the service's status as JSON."""
        self._status.log(text, log_time=at_ns + self._offset_ns)
        self._check()

    def flush(self) -> None:
        """End the chunk and hand it to the system.

        Raises:
            RecordError: that failed.
        """
        try:
            self._writer.flush()
        except RuntimeError as error:
            raise self._failure(error) from error
        self._check()

    def close(self, summary: Mapping[str, str] | None = None) -> None:
        """Write the index and close.

        Raises:
            RecordError: that failed; the file is closed nevertheless, and `uavdepth recover` reads it.
        """
        try:
            if self._file.error is None:
                if summary:
                    self._writer.write_metadata(layout.METADATA_END, dict(summary))
                self._writer.close()
        except RuntimeError as error:
            raise self._failure(error) from error
        finally:
            self._file.close()
        self._check()

    def abandon(self) -> None:
        """Close after a failure; never raises."""
        try:
            self.close()
        except RecordError:
            return

    def _check(self) -> None:
        if self._file.error is not None:
            raise self._failure(self._file.error)

    def _failure(self, error: Exception) -> RecordError:
        cause = self._file.error
        reason = str(error) if cause is None else (cause.strerror or str(cause))
        return RecordError(f"record {self._file.path}: {reason}")
