"""A record made by the service, as footage."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from mcap.records import Attachment, Channel, Message, Metadata

from service.errors import RecordError
from service.recorder import layout
from service.recorder.perception_note import PerceptionNote
from service.recorder.record_reader import RecordReader
from service.replay.footage import Packets, RecordedPicture
from service.replay.recorded_images import depth_of, image_of, sigma_of
from uavdepth.depth.depth_map import DepthMap

_MAX_MAVLINK_BYTES = 1024 * 1024 * 1024
"""A day of a fast line; a hostile file unpacks to many times its size."""

_PACKETS_BYTES = 200
"""What an arrival costs besides its data."""

_MAX_CONFIGURATION_BYTES = 1_000_000


class Recording:
    """One recording, in one file or in the parts that it was rotated into.

    Telemetry is held in memory; pictures are read as they are played.

    Args:
        paths: its files, in order.

    Raises:
        RecordError: a file that is no record of this program or of another format version.
    """

    def __init__(self, paths: Sequence[Path]) -> None:
        if not paths:
            raise RecordError("a recording of no files")
        self._paths = tuple(paths)
        self.configuration: dict[str, Any] = {}
        """Sections of the configuration that it was flown with."""
        self.vehicle = ""
        self.picture_count = 0
        """Of the main camera."""
        self.warnings: list[str] = []
        """What is wrong with the files and does not keep them from being played."""
        self._offsets_ns: dict[Path, int] = {}
        packets: list[Packets] = []
        for path in self._paths:
            packets += self._survey(path)
        packets.sort(key=lambda packet: packet.at_ns)
        self._packets = packets

    @property
    def name(self) -> str:
        """The first file's name."""
        return self._paths[0].name

    @property
    def packets(self) -> Sequence[Packets]:
        """MAVLink of both directions."""
        return self._packets

    def pictures(self) -> Iterator[RecordedPicture]:
        """The pictures that were measured, file by file."""
        for path in self._paths:
            yield from self._pictures_of(path)

    def _survey(self, path: Path) -> list[Packets]:
        """Everything but the pictures."""
        reader = RecordReader(path)
        topics: dict[int, str] = {}
        packets: list[Packets] = []
        held_bytes = 0
        offset_ns: int | None = None
        for item in reader.items():
            if isinstance(item, Metadata) and item.name == layout.METADATA:
                offset_ns = self._begin(path, item.metadata)
            elif isinstance(item, Attachment) and item.name == layout.CONFIGURATION:
                self._configure(path, item.data)
            elif isinstance(item, Channel):
                topics[item.id] = item.topic
            elif isinstance(item, Message):
                if offset_ns is None:
                    raise _not_ours(path)
                topic = topics.get(item.channel_id, "")
                self.picture_count += layout.camera_of(topic) == (layout.NOTE, "")
                at_ns = item.log_time - offset_ns
                if topic.startswith((layout.MAVLINK_OUT_TOPIC, layout.MAVLINK_IN_TOPIC)):
                    held_bytes += len(item.data) + _PACKETS_BYTES
                    if held_bytes > _MAX_MAVLINK_BYTES:
                        raise RecordError(f"{path}: more than {_MAX_MAVLINK_BYTES} bytes of MAVLink")
                if topic == layout.MAVLINK_OUT_TOPIC:
                    packets.append(Packets(at_ns, item.data, outgoing=True))
                elif topic.startswith(layout.MAVLINK_IN_TOPIC):
                    sender = topic.removeprefix(layout.MAVLINK_IN_TOPIC) or None
                    packets.append(Packets(at_ns, item.data, sender=sender))
        if offset_ns is None:
            raise _not_ours(path)
        if reader.ending is not None and not reader.ending.whole:
            self.warnings.append(f"{path}: {reader.ending.reason}; what is whole of it is played")
        return packets

    def _begin(self, path: Path, metadata: dict[str, str]) -> int:
        try:
            version = int(metadata.get("format", ""))
            offset_ns = int(metadata.get("wall_offset_ns", ""))
        except ValueError as error:
            raise RecordError(f"{path}: its metadata {layout.METADATA!r} has no format and offset") from error
        if not layout.OLDEST_FORMAT <= version <= layout.FORMAT:
            age = "a newer version of uavdepth" if version > layout.FORMAT else "an older version of uavdepth"
            written_by = metadata.get("version", "?")[:40]
            raise RecordError(
                f"{path}: record format {version}, written by {age} ({written_by}); "
                f"this one reads formats {layout.OLDEST_FORMAT} to {layout.FORMAT}"
            )
        self.vehicle = metadata.get("vehicle", "")[:64]
        self._offsets_ns[path] = offset_ns
        return offset_ns

    def _configure(self, path: Path, data: bytes) -> None:
        if len(data) > _MAX_CONFIGURATION_BYTES:
            raise RecordError(f"{path}: {layout.CONFIGURATION} of {len(data)} bytes is none of ours")
        try:
            configuration = json.loads(data)
        except ValueError as error:
            raise RecordError(f"{path}: {layout.CONFIGURATION} is no JSON") from error
        except RecursionError as error:
            raise RecordError(f"{path}: {layout.CONFIGURATION} is nested too deeply") from error
        if not isinstance(configuration, dict):
            raise RecordError(f"{path}: {layout.CONFIGURATION} is no table")
        self.configuration = configuration

    def _pictures_of(self, path: Path) -> Iterator[RecordedPicture]:
        offset_ns = self._offsets_ns[path]
        topics: dict[int, tuple[str, str] | None] = {}
        picture: RecordedPicture | None = None
        damaged = 0
        for item in RecordReader(path).items():
            if isinstance(item, Channel):
                topics[item.id] = layout.camera_of(item.topic)
                continue
            topic = topics.get(item.channel_id) if isinstance(item, Message) else None
            if topic is None or not isinstance(item, Message):
                continue
            what, camera = topic
            try:
                if what == layout.NOTE:
                    if picture is not None:
                        yield picture
                    picture = None
                    picture = RecordedPicture(PerceptionNote.decode(item.data), camera=camera)
                elif (
                    picture is not None
                    and camera == picture.camera
                    and item.log_time - offset_ns == picture.note.captured_ns
                ):
                    picture = _with(picture, what, item.data)
            except RecordError as error:
                damaged += 1
                if damaged == 1:
                    self.warnings.append(f"{path}: damaged pictures are left out ({error})")
        if picture is not None:
            yield picture


def _with(picture: RecordedPicture, what: str, data: bytes) -> RecordedPicture:
    """The picture with one more part of it. Raises RecordError if that is damaged."""
    if what == layout.IMAGE:
        return replace(picture, image_bgr=image_of(data))
    if what == layout.DEPTH:
        return replace(picture, depth=DepthMap(depth_of(data)))
    if what == layout.SIGMA and picture.depth is not None:
        sigma = sigma_of(data)
        if sigma.shape != picture.depth.depth_m.shape:
            raise RecordError(f"a recorded uncertainty of shape {sigma.shape} is not of its depth's")
        return replace(picture, depth=DepthMap(picture.depth.depth_m, sigma))
    return picture


def _not_ours(path: Path) -> RecordError:
    return RecordError(
        f"{path}: is an MCAP file, but no record of uavdepth (no metadata {layout.METADATA!r})"
    )
