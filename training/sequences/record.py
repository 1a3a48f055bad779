"""The project's own recorded flights: MCAP files of `uavdepth run --record` and `uavdepth fly-record`."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from google.protobuf.message import DecodeError
from mcap.exceptions import McapError
from mcap.reader import McapReader, make_reader
from mcap.records import Message, Schema
from numpy.typing import NDArray

from training.errors import TrainingDataError
from training.sequences.errors import BrokenFrameError
from training.sequences.pictures import decode_picture, require_size
from training.sequences.rectifier import Rectifier
from uavdepth.camera import CameraModel
from uavdepth.errors import CameraModelError

RECORD_SUFFIX = ".mcap"
IMAGE_SCHEMA, CALIBRATION_SCHEMA = "foxglove.CompressedImage", "foxglove.CameraCalibration"

_BROKEN = (McapError, EOFError, ValueError, KeyError, TypeError, RuntimeError, DecodeError)
"""What the libraries raise on bytes that are no record."""


@dataclass(frozen=True)
class RecordedFlight:
    """A `StreamedSequence` of one camera of a record, without truth: recorded depth is a network's.

    Args:
        path: the record.
        topic: of the camera's pictures, `/camera/image` or `/camera/NAME/image`.
        log_ns: times of the pictures in the record, rising.
        lens: the camera as calibrated.
    """

    path: Path
    topic: str
    log_ns: tuple[int, ...]
    lens: CameraModel
    rectifier: Rectifier = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "rectifier", Rectifier(self.lens))

    @property
    def name(self) -> str:
        """Of the file, and of the camera where it is not the main one."""
        camera = self.topic.split("/")[2:-1]
        return "/".join((self.path.stem, *camera))

    @property
    def camera(self) -> CameraModel:
        """Of the rectified pictures."""
        return self.rectifier.camera

    def __len__(self) -> int:
        return len(self.log_ns)

    def file_of(self, index: int) -> Path:
        """The record itself."""
        return self.path

    def problem(self, index: int) -> str | None:
        """None: what is damaged is known when it is decoded."""
        return None

    def image_bgr(self, index: int) -> NDArray[np.uint8]:
        """(H, W, 3) rectified picture. Raises BrokenFrameError: damaged, or of another size."""
        moment = self.log_ns[index]
        for picture in self._pictures(moment, moment + 1):
            return picture
        raise BrokenFrameError(f"picture {index} is no longer in {self.path}")

    def images_bgr(self) -> Iterator[NDArray[np.uint8]]:
        """All pictures in order. Raises BrokenFrameError: one is damaged or of another size."""
        yield from self._pictures(self.log_ns[0], self.log_ns[-1] + 1)

    def truth_m(self, index: int) -> NDArray[np.float32] | None:
        """None: what a network said is no truth."""
        return None

    def _pictures(self, start_ns: int, end_ns: int) -> Iterator[NDArray[np.uint8]]:
        last_ns = -1
        try:
            with _opened(self.path) as reader:
                for schema, _, message in reader.iter_messages(
                    [self.topic], starting_at=start_ns, ending_before=end_ns
                ):
                    if message.log_time == last_ns:
                        continue
                    last_ns = message.log_time
                    yield self._picture(_decoded(schema, message).data)
        except _BROKEN as error:
            raise BrokenFrameError(f"{self.path} is damaged: {error}") from error

    def _picture(self, content: bytes) -> NDArray[np.uint8]:
        picture = decode_picture(np.frombuffer(content, np.uint8), self.path)
        require_size(self.path, picture.shape[:2], self.lens)
        return self.rectifier.apply(picture)


def open_record(path: Path) -> list[RecordedFlight]:
    """The cameras of a record, or of all records of a folder, sorted.

    Raises:
        TrainingDataError: no record, one that is damaged or cut off, or one without pictures or calibration.
    """
    if path.is_dir():
        files = sorted(path.glob(f"*{RECORD_SUFFIX}"))
        if not files:
            raise TrainingDataError(f"no records (*{RECORD_SUFFIX}) in {path}")
        return [flight for file in files for flight in open_record(file)]
    if not path.is_file():
        raise TrainingDataError(f"no record at {path}")
    try:
        flights = _cameras(path)
    except BrokenFrameError:
        raise
    except _BROKEN as error:
        raise TrainingDataError(
            f"{path} is damaged or cut off ({error}): `uavdepth recover {path}` rescues what is left"
        ) from error
    if not flights:
        raise TrainingDataError(f"no calibrated pictures in {path}")
    return flights


def _cameras(path: Path) -> list[RecordedFlight]:
    moments: dict[str, list[int]] = {}
    lenses: dict[str, CameraModel] = {}
    with _opened(path) as reader:
        for schema, channel, message in reader.iter_messages():
            if schema is None:
                continue
            if schema.name == IMAGE_SCHEMA:
                known = moments.setdefault(channel.topic, [])
                if not known or message.log_time > known[-1]:
                    known.append(message.log_time)
            elif schema.name == CALIBRATION_SCHEMA and channel.topic not in lenses:
                lenses[channel.topic] = _lens(_decoded(schema, message), path)
    calibrated = {topic.rpartition("/")[0]: lens for topic, lens in lenses.items()}
    return [
        RecordedFlight(path, topic, tuple(times), calibrated[topic.rpartition("/")[0]])
        for topic, times in sorted(moments.items())
        if topic.rpartition("/")[0] in calibrated
    ]


def _lens(message: Any, path: Path) -> CameraModel:
    k = list(message.K)
    try:
        return CameraModel(message.width, message.height, k[0], k[4], k[2], k[5], tuple(message.D))
    except (CameraModelError, IndexError) as error:
        raise TrainingDataError(f"the calibration in {path} is none: {error}") from error


def _decoded(schema: Schema | None, message: Message) -> Any:
    """A message by the definition that the record brings along."""
    if schema is None or schema.encoding != "protobuf":
        raise ValueError("a message without a protobuf schema")
    return _message_class(schema.name, schema.data).FromString(message.data)


@lru_cache(maxsize=16)
def _message_class(name: str, definition: bytes) -> Any:
    files = descriptor_pb2.FileDescriptorSet.FromString(definition)
    pool = descriptor_pool.DescriptorPool()
    for file in _dependencies_first(list(files.file)):
        pool.Add(file)
    return message_factory.GetMessageClass(pool.FindMessageTypeByName(name))


def _dependencies_first(files: list[Any]) -> list[Any]:
    ordered: list[Any] = []
    while files:
        names = {file.name for file in ordered}
        ready = [file for file in files if names.issuperset(file.dependency)]
        if not ready:
            raise ValueError("a schema that lacks a part of itself")
        ordered += ready
        files = [file for file in files if file not in ready]
    return ordered


@contextmanager
def _opened(path: Path) -> Iterator[McapReader]:
    try:
        file = path.open("rb")
    except OSError as error:
        raise BrokenFrameError(f"{path} cannot be read: {error.strerror}") from error
    with file:
        yield make_reader(file)
