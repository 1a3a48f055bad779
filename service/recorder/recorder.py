"""The recorder: a thread behind a bounded queue, for which nobody waits."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Hashable
from importlib.metadata import version

import structlog

from service.clock import Clock
from service.errors import RecordError
from service.perception_result import PerceptionResult
from service.recorder.byte_queue import ByteQueue
from service.recorder.disk_sync import DiskSync
from service.recorder.items import Item, PacketsItem, PictureItem, StatusItem
from service.recorder.part import Part
from service.recorder.record_writer import RecordHeader, RecordWriter
from service.recorder.recorded_configuration import recorded_configuration
from service.recorder.recorder_status import RecorderStatus
from service.recorder.shelf import Shelf, Take
from service.settings import Settings
from service.thread_rank import stand_back

log = structlog.get_logger()

_MIB = 1024 * 1024
_TAKE_S = 0.1
_FLUSH_NS = 400_000_000
"""What a crash may cost, with the time of writing and with what waits: a second together."""
_CARE_NS = 1_000_000_000
"""How often the disk is asked to keep what the system has, and is looked at."""
_BEHIND_NS = 1_000_000_000
"""What waits longer is told."""
_RETRY_NS = 5_000_000_000
_JOIN_S = 5.0
_SYNC_S = 0.5


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
        self._queue: ByteQueue[Item] = ByteQueue(settings.record.queue_mib * _MIB)
        self._take: Take | None = None
        self._number = 0
        self._part: Part | None = None
        self._senders: dict[Hashable, int] = {}
        self._sync = DiskSync()
        self._flush_due_ns = self._care_due_ns = 0
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
        self._sync.start()
        self._thread.start()

    def offer(self, result: PerceptionResult, begun_ns: int, done_ns: int, camera: str = "") -> None:
        """Record a picture and what became of it; see `PictureItem`."""
        self._put(PictureItem(result, begun_ns, done_ns, camera))

    def offer_packets(self, data: bytes, at_ns: int, outgoing: bool, source: Hashable = None) -> None:
        """Record bytes of the MAVLink line."""
        self._put(PacketsItem(data, at_ns, outgoing, source))

    def offer_status(self, text: bytes) -> None:
        """Record the service's status, as JSON text."""
        self._put(StatusItem(text, self._clock.now_ns()))

    def status(self) -> RecorderStatus:
        """The recorder now."""
        oldest = self._queue.oldest
        behind_ns = 0 if oldest is None else self._clock.now_ns() - oldest.at_ns
        with self._counting:
            problem = self._problem
            if not problem and behind_ns > _BEHIND_NS:
                problem = f"{behind_ns / 1e9:.1f} s behind: disk or processor is slow"
            return RecorderStatus(
                recording=self._part is not None and not self._problem,
                path=self._newest,
                pictures=self._pictures,
                packets=self._packets,
                dropped_pictures=self._dropped_pictures,
                dropped_packets=self._dropped_packets,
                bytes=self._bytes,
                problem=problem,
            )

    def stop(self) -> None:
        """Write what waits and close the file; gives up on a disk that takes longer than 5 s."""
        self._queue.close()
        if self._thread.is_alive():
            self._thread.join(_JOIN_S)
            if self._thread.is_alive():
                log.warning("the recorder's disk does not answer; `uavdepth recover` reads what it has")
        self._sync.stop(_SYNC_S)

    def _put(self, item: Item) -> None:
        if not self._queue.put(item, item.size_bytes, large=isinstance(item, PictureItem)):
            self._drop(item)

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
            if item is not None and not written:
                self._drop(item)
        self._close()

    def _write(self, item: Item) -> bool:
        """Write an item; False if there is no file for it now."""
        part = self._open_if_due()
        if part is None or not part.write(item):
            return False
        self._pictures += isinstance(item, PictureItem)
        self._packets += isinstance(item, PacketsItem)
        return True

    def _open_if_due(self) -> Part | None:
        """The open part, the next where it is full, or None while the disk is not to be had."""
        if self._part is not None and self._part.size > self._record.max_file_mib * _MIB:
            self._close()
        if self._part is not None:
            return self._part
        now_ns = self._clock.now_ns()
        if now_ns < self._retry_due_ns or self._take is None:
            return None
        self._shelf.make_room(self._take, self._number)
        self._number += 1
        header = RecordHeader(
            vehicle=self._settings.vehicle.name,
            version=version("uavdepth"),
            wall_offset_ns=self._wall_offset_ns,
            configuration=recorded_configuration(self._settings),
            part=self._number,
            model_card=self._model_card(),
        )
        path = self._take.part(self._number, ".mcap")
        self._part = Part(path, header, self._settings, self._senders, self._open_writer)
        self._flush_due_ns, self._care_due_ns = now_ns + _FLUSH_NS, now_ns + _CARE_NS
        self._newest = str(path)
        log.info("recording", file=str(path))
        self._problem = ""
        return self._part

    def _flush_if_due(self) -> None:
        now_ns = self._clock.now_ns()
        if self._part is None or self._take is None or now_ns < self._flush_due_ns:
            return
        self._flush_due_ns = now_ns + _FLUSH_NS
        self._part.flush()
        if now_ns < self._care_due_ns:
            return
        self._care_due_ns = now_ns + _CARE_NS
        error, self._sync.error = self._sync.error, None
        if error is not None:
            raise RecordError(f"record {self._part.path}: {error.strerror or error}")
        self._sync.ask(self._part.path)
        self._shelf.make_room(self._take, self._number)

    def _fail(self, reason: str) -> None:
        """Leave the file and try again later; say so once."""
        if not self._problem:
            log.warning("recording has stopped", problem=reason, tried_again_every_s=_RETRY_NS / 1e9)
        self._problem = reason
        self._retry_due_ns = self._clock.now_ns() + _RETRY_NS
        self._close()
        if self._take is not None:
            self._shelf.drop_empty(self._take, self._number)

    def _close(self) -> None:
        part, self._part = self._part, None
        if part is None:
            return
        summary = {
            "pictures": str(self._pictures),
            "packets": str(self._packets),
            "dropped_pictures": str(self._dropped_pictures),
            "dropped_packets": str(self._dropped_packets),
        }
        try:
            part.close(summary)
        except RecordError as error:
            log.warning("a record was not closed; `uavdepth recover` reads it", problem=str(error))
        self._bytes += part.total_size
        self._sync.ask(part.path)

    def _drop(self, item: Item) -> None:
        with self._counting:
            self._dropped_pictures += isinstance(item, PictureItem)
            self._dropped_packets += isinstance(item, PacketsItem)
