"""A record from beginning to end, however it ends: whole, cut off, or not a record at all."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import lz4.frame
import zstandard
from mcap.exceptions import EndOfFile, McapError, RecordLengthLimitExceeded
from mcap.records import Attachment, Channel, Chunk, McapRecord, Message, Metadata, Schema
from mcap.stream_reader import StreamReader, breakup_chunk

from service.errors import RecordError

_MAX_RECORD_BYTES = 2 * 4096 * 4096 + 2**20
"""Depth of the largest camera (4096 x 4096, 16 bits) and what comes before it in a chunk; hostile files claim
exabytes."""

_MAX_NAMES = 10_000
"""Channels and schemas of one file."""

_BROKEN = (
    McapError,
    EOFError,
    struct.error,
    ValueError,
    OverflowError,
    KeyError,
    IndexError,
    MemoryError,
    RuntimeError,
    zstandard.ZstdError,
)
"""What the MCAP library raises on bytes that are no MCAP (found by fuzzing)."""

Item = Schema | Channel | Message | Metadata | Attachment


@dataclass(frozen=True)
class Ending:
    """How a file ended.

    Args:
        whole: it was closed as it should be.
        reason: what was found instead; empty if whole.
        good_bytes: bytes up to the last thing that could be read.
        total_bytes: size of the file.
    """

    whole: bool
    reason: str
    good_bytes: int
    total_bytes: int


class RecordReader:
    """Reads an MCAP file once, in the order in which it was written; needs no index.

    Args:
        path: the file.

    Raises:
        RecordError: it cannot be opened, is empty, or is no MCAP file.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.ending: Ending | None = None
        """How the file ended, once `items` is through."""
        with _opened(path) as file:
            head = file.read(8)
        if not head:
            raise RecordError(f"{path}: is empty")
        if head != b"\x89MCAP0\r\n":
            raise RecordError(f"{path}: is no MCAP file (it begins with {head!r})")

    def items(self) -> Iterator[Item]:
        """Everything that can be read, chunks opened. A damaged chunk is left out, a cut file ends there.

        `ending` tells afterwards whether something is missing.
        """
        total = self.path.stat().st_size
        good, reason, whole, names = 8, "", False, 0
        with _opened(self.path) as file:
            records = StreamReader(file, emit_chunks=True, record_size_limit=_MAX_RECORD_BYTES).records
            while True:
                try:
                    record = next(records, None)
                    inside = [record] if not isinstance(record, Chunk) else _open_chunk(record)
                except _BROKEN as error:
                    if isinstance(error, EndOfFile):
                        reason = reason or "it is cut off"
                        break
                    reason = reason or _words(error)
                    if file.tell() <= good:
                        break
                    # The record was read and only its inside is damaged: the next one may be whole.
                    if not isinstance(error, _ChunkError):
                        break
                    continue
                if record is None:
                    whole = not reason
                    break
                good = file.tell()
                for item in inside:
                    if isinstance(item, Schema | Channel):
                        names += 1
                        if names > _MAX_NAMES:
                            raise RecordError(f"{self.path}: more than {_MAX_NAMES} channels and schemas")
                    if isinstance(item, Schema | Channel | Message | Metadata | Attachment):
                        yield item
        self.ending = Ending(whole, reason, good, total)


class _ChunkError(McapError):
    """A chunk whose inside is damaged."""


def _open_chunk(chunk: Chunk) -> list[McapRecord]:
    """The records in a chunk, which must not grow beyond what it says it holds."""
    try:
        data = _unpacked(chunk)
        if chunk.uncompressed_crc and zlib.crc32(data) != chunk.uncompressed_crc:
            raise _ChunkError("a chunk has the wrong checksum")
        chunk.compression, chunk.data = "", data
        return breakup_chunk(chunk)
    except _BROKEN as error:
        raise _ChunkError(_words(error)) from error


def _unpacked(chunk: Chunk) -> bytes:
    size = chunk.uncompressed_size
    if size > _MAX_RECORD_BYTES:
        raise _ChunkError(f"a chunk claims to hold {size} bytes: at most {_MAX_RECORD_BYTES} are read")
    if chunk.compression == "":
        return chunk.data
    if chunk.compression == "zstd":
        with zstandard.ZstdDecompressor(max_window_size=2**27).stream_reader(chunk.data) as stream:
            data: bytes = stream.read(size + 1)
    elif chunk.compression == "lz4":
        data = lz4.frame.LZ4FrameDecompressor().decompress(chunk.data, max_length=size + 1)
    else:
        raise _ChunkError(f"a chunk is compressed with {chunk.compression[:20]!r}: zstd and lz4 are known")
    if len(data) != size:
        raise _ChunkError(f"a chunk claims to hold {size} bytes and does not")
    return data


def _opened(path: Path) -> BinaryIO:
    try:
        return path.open("rb")
    except FileNotFoundError as error:
        raise RecordError(f"{path}: no such file") from error
    except OSError as error:
        raise RecordError(f"{path}: cannot be read: {error.strerror}") from error


def _words(error: BaseException) -> str:
    if isinstance(error, RecordLengthLimitExceeded):
        # The length of a chunk is filled in when it is finished; until then every bit of it is set.
        unfinished = str(2**64 - 1) in str(error)
        return "it is cut off inside a chunk" if unfinished else str(error)
    named = isinstance(error, McapError) and str(error)
    return str(error) if named else f"it is damaged ({type(error).__name__})"
