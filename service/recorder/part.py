"""One part of a recording: the record, and the telemetry log beside it."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping
from pathlib import Path

from service.publisher.rate_limit import RateLimit
from service.recorder import messages
from service.recorder.camera_channels import recorded_cameras
from service.recorder.items import Item, PacketsItem, PictureItem
from service.recorder.perception_note import PerceptionNote
from service.recorder.record_writer import MAX_SENDERS, RecordHeader, RecordWriter
from service.recorder.tlog_writer import TlogWriter
from service.settings import Settings


class Part:
    """Writes what waited. One thread.

    Args:
        path: the new record; nothing is overwritten.
        header: what it begins with.
        settings: the configuration.
        senders: numbers of the senders on the line, which stay the same in all parts.
        open_writer: opens the record.

    Raises:
        OSError: a file that exists or cannot be made.
        RecordError: a record that cannot be begun.
    """

    def __init__(
        self,
        path: Path,
        header: RecordHeader,
        settings: Settings,
        senders: dict[Hashable, int],
        open_writer: Callable[..., RecordWriter] = RecordWriter,
    ) -> None:
        self.path = path
        self._settings = settings.record
        self._offset_ns = header.wall_offset_ns
        self._senders = senders
        self._depth_limits: dict[str, RateLimit] = {}
        self._writer = open_writer(path, header, recorded_cameras(settings))
        self._tlog: TlogWriter | None = None
        if self._settings.tlog:
            try:
                self._tlog = TlogWriter(path.with_suffix(".tlog"))
            except OSError:
                self._writer.abandon()
                raise

    @property
    def size(self) -> int:
        """Bytes of the record so far."""
        return self._writer.size

    @property
    def total_size(self) -> int:
        """Bytes of both files so far."""
        return self._writer.size + (0 if self._tlog is None else self._tlog.size)

    def write(self, item: Item) -> bool:
        """Write an item; False if it is one of a sender beyond the eighth, whose bytes are not kept.

        Raises:
            OSError, RecordError: it cannot be written.
        """
        if isinstance(item, PictureItem):
            self._write_picture(item)
        elif isinstance(item, PacketsItem):
            return self._write_packets(item)
        else:
            self._writer.status(item.text, item.at_ns)
        return True

    def flush(self) -> None:
        """Hand everything to the system. Raises OSError and RecordError."""
        self._writer.flush()
        if self._tlog is not None:
            self._tlog.flush()

    def close(self, summary: Mapping[str, str]) -> None:
        """Write the index and close.

        Raises:
            RecordError: that failed; the files are closed nevertheless, and `uavdepth recover` reads them.
        """
        if self._tlog is not None:
            self._tlog.close()
        self._writer.close(summary)

    def _write_picture(self, item: PictureItem) -> None:
        result, camera, writer = item.result, item.camera, self._writer
        captured_ns, wall_ns = result.captured_ns, result.captured_ns + self._offset_ns
        writer.note(PerceptionNote.of(result, item.begun_ns, item.done_ns), camera)
        if self._settings.camera:
            quality = self._settings.camera_quality
            image = messages.compressed_image(result.frame.image_bgr, quality, wall_ns, camera)
            writer.image(image, captured_ns, camera)
        depth = result.depth
        if depth is None or not self._is_depth_due(camera, captured_ns):
            return
        writer.depth(messages.depth_image(depth.depth_m, wall_ns, camera), captured_ns, camera)
        if depth.relative_sigma is not None:
            sigma = messages.sigma_image(depth.relative_sigma, wall_ns, camera)
            writer.sigma(sigma, captured_ns, camera)

    def _is_depth_due(self, camera: str, captured_ns: int) -> bool:
        rate_hz = self._settings.depth_rate_hz
        if rate_hz <= 0:
            return False
        return self._depth_limits.setdefault(camera, RateLimit(rate_hz)).allows(captured_ns)

    def _write_packets(self, item: PacketsItem) -> bool:
        sender = 0 if item.outgoing else self._sender(item.source)
        if sender is None:
            return False
        self._writer.packets(item.data, item.at_ns, outgoing=item.outgoing, sender=sender)
        if self._tlog is not None:
            wall_ns = item.at_ns + self._offset_ns
            self._tlog.write(item.data, wall_ns, outgoing=item.outgoing, sender=sender)
        return True

    def _sender(self, source: Hashable) -> int | None:
        """A number for each sender on the line; None for those beyond the eighth."""
        if source not in self._senders and len(self._senders) >= MAX_SENDERS:
            return None
        return self._senders.setdefault(source, len(self._senders))
