"""Rescue of a record that was cut off: everything that can be read goes into a new, whole file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from mcap.records import Attachment, Channel, Message, Metadata, Schema
from mcap.writer import CompressionType, Writer

from service.errors import RecordError
from service.recorder import layout
from service.recorder.record_reader import Ending, RecordReader


@dataclass(frozen=True)
class Rescue:
    """What was rescued.

    Args:
        output: the new file.
        messages: messages in it.
        seconds: from the first to the last message, by their log times.
        ending: how the old file ended.
    """

    output: Path
    messages: int
    seconds: float
    ending: Ending


def recover(path: Path, output: Path | None = None, *, force: bool = False) -> Rescue:
    """Write what is whole of a record into a new file.

    Args:
        path: the damaged file; it is not touched.
        output: the new file; None: `NAME-recovered.mcap` beside it.
        force: replace an existing output.

    Raises:
        RecordError: the file holds nothing to rescue, or the output exists or cannot be written.
    """
    reader = RecordReader(path)
    output = path.with_name(f"{path.stem}-recovered.mcap") if output is None else output
    if output.exists() and output.samefile(path):
        raise RecordError(f"{output}: is the damaged file itself; name another")
    if output.exists() and not force:
        raise RecordError(f"{output}: exists; --force replaces it")
    # Beside the output and renamed at the end: a failure leaves no half rescue under the final name.
    unfinished = output.with_name(f".{output.name}.unfinished")
    try:
        with unfinished.open("wb") as file:
            writer = Writer(file, chunk_size=layout.CHUNK_BYTES, compression=CompressionType.ZSTD)
            writer.start(library="uavdepth recover")
            messages, seconds = _copy(reader, writer)
            writer.finish()  # type: ignore[no-untyped-call]
        if messages == 0:
            raise RecordError(f"{path}: holds no message that can be read")
        unfinished.replace(output)
    except OSError as error:
        raise RecordError(f"{output}: cannot be written: {error.strerror}") from error
    finally:
        unfinished.unlink(missing_ok=True)
    if reader.ending is None:
        raise RecordError(f"{path}: was not read to its end")
    return Rescue(output, messages, seconds, reader.ending)


def _copy(reader: RecordReader, writer: Writer) -> tuple[int, float]:
    """Messages written, and the seconds that they span."""
    schemas, channels = {0: 0}, dict[int, int]()
    known: set[tuple[str, int]] = set()
    count, first_ns, last_ns = 0, 0, 0
    for item in reader.items():
        if isinstance(item, Schema):
            if ("schema", item.id) not in known:
                schemas[item.id] = writer.register_schema(item.name, item.encoding, item.data)
        elif isinstance(item, Channel):
            if ("channel", item.id) not in known:
                schema = schemas.get(item.schema_id, 0)
                channels[item.id] = writer.register_channel(
                    item.topic, item.message_encoding, schema, item.metadata
                )
        elif isinstance(item, Metadata):
            writer.add_metadata(item.name, item.metadata)
        elif isinstance(item, Attachment):
            writer.add_attachment(item.create_time, item.log_time, item.name, item.media_type, item.data)
        elif isinstance(item, Message) and item.channel_id in channels:
            writer.add_message(
                channels[item.channel_id], item.log_time, item.data, item.publish_time, item.sequence
            )
            first_ns = item.log_time if count == 0 else min(first_ns, item.log_time)
            last_ns, count = max(last_ns, item.log_time), count + 1
        if isinstance(item, Schema | Channel):
            known.add((type(item).__name__.lower(), item.id))
    return count, (last_ns - first_ns) / 1e9
