"""A record made by the service, as footage."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from mcap.records import Attachment, Channel, Message, Metadata
from numpy.typing import NDArray

from service.errors import RecordError
from service.ground.errors import PictureError
from service.ground.pictures import check_jpeg
from service.recorder import layout
from service.recorder.perception_note import PerceptionNote
from service.recorder.record_reader import RecordReader
from service.replay.footage import Packets, RecordedPicture
from service.replay.protobuf_fields import protobuf_fields

_MAX_PIXELS = 4096 * 4096
_MAX_PICTURE_BYTES = 3 * _MAX_PIXELS
_MAX_CONFIGURATION_BYTES = 1_000_000
_IMAGE_DATA = 2
_RAW_WIDTH, _RAW_HEIGHT, _RAW_ENCODING, _RAW_STEP, _RAW_DATA = 2, 3, 4, 5, 6


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
        self.image_count = 0
        self.depth_count = 0
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
                self.picture_count += topic == layout.PERCEPTION_TOPIC
                self.image_count += topic == layout.CAMERA_TOPIC
                self.depth_count += topic == layout.DEPTH_TOPIC
                at_ns = item.log_time - offset_ns
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
        if version != layout.FORMAT:
            age = "a newer version of uavdepth" if version > layout.FORMAT else "an older version of uavdepth"
            written_by = metadata.get("version", "?")[:40]
            raise RecordError(
                f"{path}: record format {version}, written by {age} ({written_by}); "
                f"this one reads format {layout.FORMAT}"
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
        topics: dict[int, str] = {}
        note: PerceptionNote | None = None
        image: NDArray[np.uint8] | None = None
        depth_m: NDArray[np.float32] | None = None
        damaged = 0
        for item in RecordReader(path).items():
            if isinstance(item, Channel):
                topics[item.id] = item.topic
                continue
            if not isinstance(item, Message):
                continue
            topic = topics.get(item.channel_id, "")
            try:
                if topic == layout.PERCEPTION_TOPIC:
                    if note is not None:
                        yield RecordedPicture(note, image, depth_m)
                    note, image, depth_m = None, None, None
                    note = PerceptionNote.decode(item.data)
                elif note is None or item.log_time - offset_ns != note.captured_ns:
                    continue
                elif topic == layout.CAMERA_TOPIC:
                    image = image_of(item.data)
                elif topic == layout.DEPTH_TOPIC:
                    depth_m = depth_of(item.data)
            except RecordError as error:
                damaged += 1
                if damaged == 1:
                    self.warnings.append(f"{path}: damaged pictures are left out ({error})")
        if note is not None:
            yield RecordedPicture(note, image, depth_m)


def image_of(data: bytes) -> NDArray[np.uint8]:
    """(H, W, 3) uint8 picture of a `foxglove.CompressedImage`.

    Raises:
        RecordError: it holds no picture.
    """
    jpeg = protobuf_fields(data).get(_IMAGE_DATA)
    if not isinstance(jpeg, bytes) or not jpeg:
        raise RecordError("a recorded picture is empty")
    try:
        # OpenCV takes 10 s and gigabytes for a few hundred bytes that claim to be huge.
        check_jpeg(jpeg, _MAX_PICTURE_BYTES)
        image = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR)
    except PictureError as error:
        raise RecordError(f"a recorded picture cannot be decoded: {error}") from error
    except cv2.error as error:
        raise RecordError(f"a recorded picture cannot be decoded: {error.err}") from error
    if image is None:
        raise RecordError("a recorded picture cannot be decoded")
    return np.asarray(image, np.uint8)


def depth_of(data: bytes) -> NDArray[np.float32]:
    """(H, W) float32 metres of a `foxglove.RawImage` in 16UC1 millimetres, NaN where it is 0.

    Raises:
        RecordError: it is no such picture.
    """
    fields = protobuf_fields(data)
    width, height, step = fields.get(_RAW_WIDTH, 0), fields.get(_RAW_HEIGHT, 0), fields.get(_RAW_STEP, 0)
    encoding, packed = fields.get(_RAW_ENCODING, b""), fields.get(_RAW_DATA, b"")
    if not (isinstance(width, int) and isinstance(height, int) and isinstance(packed, bytes)):
        raise RecordError("a recorded depth picture is damaged")
    if encoding != b"16UC1" or not 0 < width * height <= _MAX_PIXELS or step != 2 * width:
        raise RecordError(f"a recorded depth picture is {width}x{height} of {encoding!r}: 16UC1 is needed")
    if len(packed) != step * height:
        raise RecordError(f"a recorded depth picture has {len(packed)} bytes: {step * height} are needed")
    millimetres = np.frombuffer(packed, "<u2").reshape(height, width)
    return np.where(millimetres == 0, np.nan, millimetres / 1000.0).astype(np.float32)


def _not_ours(path: Path) -> RecordError:
    return RecordError(
        f"{path}: is an MCAP file, but no record of uavdepth (no metadata {layout.METADATA!r})"
    )
