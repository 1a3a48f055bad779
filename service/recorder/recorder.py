"""The recorder: a thread behind a bounded queue, for which nobody waits."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Hashable
from dataclasses import dataclass
from importlib.metadata import version

import structlog

from service.clock import Clock
from service.errors import RecordError
from service.perception_result import PerceptionResult
from service.publisher.rate_limit import RateLimit
from service.recorder import messages
from service.recorder.byte_queue import ByteQueue
from service.recorder.perception_note import PerceptionNote
from service.recorder.record_writer import MAX_SENDERS, RecordHeader, RecordWriter
from service.recorder.recorded_configuration import recorded_configuration
from service.recorder.recorder_status import RecorderStatus
from service.recorder.shelf import Shelf, Take
from service.recorder.tlog_writer import TlogWriter
from service.settings import Settings
from service.thread_rank import stand_back

log = structlog.get_logger()

_MIB = 1024 * 1024
_TAKE_S = 0.1
_FLUSH_NS = 1_000_000_000
"""What a crash may cost."""
_RETRY_NS = 5_000_000_000
_JOIN_S = 5.0
_ITEM_BYTES = 200
"""What an item costs besides its data."""


@dataclass(frozen=True)
class _Picture:
    result: PerceptionResult
    begun_ns: int
    done_ns: int


@dataclass(frozen=True)
class _Packets:
    data: bytes
    at_ns: int
    outgoing: bool
    source: Hashable


@dataclass(frozen=True)
class _Status:
    text: bytes
    at_ns: int


class Recorder:
    """Writes what it is offered to `[record] folder`; every `offer` returns at once.

    A full or broken disk ends the file, is told once, and is tried again every 5 s in a new one.

    Args:
        settings: the configuration.
        clock: the service's.
        model_card: tells the network's card as JSON text once it is loaded.
        wall_ns: nanoseconds since 1970.
        open_writer: opens one file; for tests.
    """

    def __init__(
        self,
        settings: Settings,
        clock: Clock,
        model_card: Callable[[], str | None] = lambda: None,
        wall_ns: Callable[[], int] = time.time_ns,
        open_writer: Callable[..., RecordWriter] = RecordWriter,
    ) -> None:
        self._settings = settings
        self._record = settings.record
        self._clock = clock
        self._model_card = model_card
        self._open_writer = open_writer
        self._wall_offset_ns = wall_ns() - clock.now_ns()
        self._shelf = Shelf(settings.record, settings.vehicle.name)
        self._queue: ByteQueue[_Picture | _Packets | _Status] = ByteQueue(settings.record.queue_mib * _MIB)
        self._take: Take | None = None
        self._part = 0
        self._writer: RecordWriter | None = None
        self._tlog: TlogWriter | None = None
        self._senders: dict[Hashable, int] = {}
        depth_hz = settings.record.depth_rate_hz
        self._depth_limit = RateLimit(depth_hz) if depth_hz > 0 else None
        self._flush_due_ns = 0
        self._retry_due_ns = 0
        self._problem = ""
        self._newest: str | None = None
        self._bytes = 0
        self._pictures = self._packets = 0
        self._dropped_pictures = self._dropped_packets = 0
        self._counting = threading.Lock()
        self._thread = threading.Thread(target=self._run, name="recorder", daemon=True)

    def start(self) -> None:
        """Begin.

        Raises:
            RecordError: the folder cannot be made.
        """
        self._shelf.make()
        self._take = self._shelf.new_take(self._clock.now_ns() + self._wall_offset_ns)
        self._thread.start()

    def offer(self, result: PerceptionResult, begun_ns: int, done_ns: int) -> None:
        """Record a picture and what became of it; see `PerceptionNote`."""
        size = result.frame.image_bgr.nbytes + _ITEM_BYTES
        if result.depth is not None:
            size += result.depth.depth_m.nbytes
        if not self._queue.put(_Picture(result, begun_ns, done_ns), size, large=True):
            self._drop_picture()

    def offer_packets(self, data: bytes, at_ns: int, outgoing: bool, source: Hashable = None) -> None:
        """Record bytes of the MAVLink line."""
        if not self._queue.put(_Packets(data, at_ns, outgoing, source), len(data) + _ITEM_BYTES):
            self._drop_packets()

    def offer_status(self, text: bytes) -> None:
        """Record the service's status, as JSON text."""
        self._queue.put(_Status(text, self._clock.now_ns()), len(text) + _ITEM_BYTES)

    def status(self) -> RecorderStatus:
        """The recorder now."""
        with self._counting:
            return RecorderStatus(
                recording=self._writer is not None and not self._problem,
                path=self._newest,
                pictures=self._pictures,
                packets=self._packets,
                dropped_pictures=self._dropped_pictures,
                dropped_packets=self._dropped_packets,
                bytes=self._bytes,
                problem=self._problem,
            )

    def stop(self) -> None:
        """Write what waits and close the file; gives up on a disk that takes longer than 5 s."""
        self._queue.close()
        if self._thread.is_alive():
            self._thread.join(_JOIN_S)
            if self._thread.is_alive():
                log.warning("the recorder's disk does not answer; `uavdepth recover` reads what it has")

    # -- the thread

    def _run(self) -> None:
        stand_back()
        while not self._queue.finished:
            item = self._queue.take(_TAKE_S)
            written = False
            try:
                written = item is not None and self._write(item)
                self._flush_if_due()
            except (RecordError, OSError) as error:
                self._fail(str(error))
            except Exception as error:
                # Whatever breaks here, the flight goes on and so does the next file.
                log.exception("recorder broke")
                self._fail(f"{type(error).__name__}: {error}")
            if isinstance(item, _Picture) and not written:
                self._drop_picture()
            elif isinstance(item, _Packets) and not written:
                self._drop_packets()
        self._close()

    def _write(self, item: _Picture | _Packets | _Status) -> bool:
        """Write an item; False if there is no file for it now."""
        writer = self._open_if_due()
        if writer is None:
            return False
        if isinstance(item, _Picture):
            self._write_picture(writer, item)
        elif isinstance(item, _Packets):
            self._write_packets(writer, item)
        else:
            writer.status(item.text, item.at_ns)
        return True

    def _write_picture(self, writer: RecordWriter, item: _Picture) -> None:
        result = item.result
        captured_ns, wall_ns = result.captured_ns, result.captured_ns + self._wall_offset_ns
        writer.note(PerceptionNote.of(result, item.begun_ns, item.done_ns))
        if self._record.camera:
            image = messages.compressed_image(result.frame.image_bgr, self._record.camera_quality, wall_ns)
            writer.image(image, captured_ns)
        depth, limit = result.depth, self._depth_limit
        if depth is not None and limit is not None and limit.allows(captured_ns):
            writer.depth(messages.depth_image(depth.depth_m, wall_ns), captured_ns)
        self._pictures += 1

    def _write_packets(self, writer: RecordWriter, item: _Packets) -> None:
        sender = 0 if item.outgoing else self._sender(item.source)
        if sender is None:
            self._drop_packets()
            return
        writer.packets(item.data, item.at_ns, outgoing=item.outgoing, sender=sender)
        if self._tlog is not None:
            wall_ns = item.at_ns + self._wall_offset_ns
            self._tlog.write(item.data, wall_ns, outgoing=item.outgoing, sender=sender)
        self._packets += 1

    def _sender(self, source: Hashable) -> int | None:
        """A number for each sender on the line; None for those beyond the eighth."""
        if source not in self._senders and len(self._senders) >= MAX_SENDERS:
            return None
        return self._senders.setdefault(source, len(self._senders))

    def _open_if_due(self) -> RecordWriter | None:
        """The open file, a new part where the old one is full, or None while the disk is not to be had."""
        if self._writer is not None and self._writer.size > self._record.max_file_mib * _MIB:
            self._close()
        if self._writer is not None:
            return self._writer
        now_ns = self._clock.now_ns()
        if now_ns < self._retry_due_ns or self._take is None:
            return None
        self._shelf.make_room(self._take, self._part)
        self._part += 1
        header = RecordHeader(
            vehicle=self._settings.vehicle.name,
            version=version("uavdepth"),
            wall_offset_ns=self._wall_offset_ns,
            configuration=recorded_configuration(self._settings),
            part=self._part,
            model_card=self._model_card(),
        )
        path = self._take.part(self._part, ".mcap")
        self._writer = self._open_writer(
            path, header, self._settings.camera.model, self._settings.mount.mount
        )
        if self._record.tlog:
            self._tlog = TlogWriter(path.with_suffix(".tlog"))
        self._flush_due_ns = now_ns + _FLUSH_NS
        self._newest = str(path)
        log.info("recording", file=str(path))
        self._problem = ""
        return self._writer

    def _flush_if_due(self) -> None:
        now_ns = self._clock.now_ns()
        if self._writer is None or self._take is None or now_ns < self._flush_due_ns:
            return
        self._flush_due_ns = now_ns + _FLUSH_NS
        self._writer.flush(sync=True)
        if self._tlog is not None:
            self._tlog.flush()
        self._shelf.make_room(self._take, self._part)

    def _fail(self, reason: str) -> None:
        """Leave the file and try again later; say so once."""
        if not self._problem:
            log.warning("recording has stopped", problem=reason, tried_again_every_s=_RETRY_NS / 1e9)
        self._problem = reason
        self._retry_due_ns = self._clock.now_ns() + _RETRY_NS
        was_open = self._writer is not None
        self._close()
        if was_open and self._take is not None:
            self._shelf.drop_empty(self._take, self._part)

    def _close(self) -> None:
        writer, self._writer = self._writer, None
        tlog, self._tlog = self._tlog, None
        if tlog is not None:
            tlog.close()
            self._bytes += tlog.size
        if writer is None:
            return
        summary = {
            "pictures": str(self._pictures),
            "packets": str(self._packets),
            "dropped_pictures": str(self._dropped_pictures),
            "dropped_packets": str(self._dropped_packets),
        }
        try:
            writer.close(summary)
        except RecordError as error:
            log.warning("a record was not closed; `uavdepth recover` reads it", problem=str(error))
        self._bytes += writer.size

    def _drop_picture(self) -> None:
        with self._counting:
            self._dropped_pictures += 1

    def _drop_packets(self) -> None:
        with self._counting:
            self._dropped_packets += 1
