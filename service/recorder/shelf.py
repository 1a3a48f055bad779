"""The folder of records: names, free space and the cap on everything together."""

from __future__ import annotations

import re
import shutil
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from service.errors import RecordError
from service.settings.record import RecordSettings

_MIB = 1024 * 1024
_OURS = re.compile(r"^uavdepth-[A-Za-z0-9_-]+-\d{8}T\d{6}Z(-\d+)?-\d{3,}\.(mcap|tlog)$")
"""What the recorder names its files: only these are ever deleted."""


@dataclass(frozen=True)
class Take:
    """The name of one recording: its parts are `<stem>-001.mcap`, `<stem>-002.mcap`, ...

    Args:
        stem: path without part and suffix.
    """

    stem: Path

    def part(self, number: int, suffix: str) -> Path:
        """The file of a part."""
        return self.stem.with_name(f"{self.stem.name}-{number:03d}{suffix}")


class Shelf:
    """Where records are kept.

    Args:
        settings: `[record]`.
        vehicle: whose records.
    """

    def __init__(self, settings: RecordSettings, vehicle: str) -> None:
        self._folder = Path(settings.folder).expanduser()
        self._vehicle = vehicle
        self._max_bytes = settings.max_total_mib * _MIB
        self._min_free_bytes = settings.min_free_mib * _MIB
        self._deletes = settings.when_full == "delete-oldest"

    def make(self) -> None:
        """Make the folder.

        Raises:
            RecordError: it cannot be made, or is no folder.
        """
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise RecordError(f"[record] folder {self._folder}: {error.strerror}") from error

    def new_take(self, wall_ns: int) -> Take:
        """A name that no file has."""
        stamp = datetime.fromtimestamp(wall_ns / 1e9, UTC).strftime("%Y%m%dT%H%M%SZ")
        stem = self._folder / f"uavdepth-{self._vehicle}-{stamp}"
        take, number = Take(stem), 1
        while take.part(1, ".mcap").exists() or take.part(1, ".tlog").exists():
            number += 1
            take = Take(stem.with_name(f"{stem.name}-{number}"))
        return take

    def make_room(self, take: Take, part: int) -> None:
        """See to it that the cap holds and the disk has room, before and while part `part` is written.

        Raises:
            RecordError: there is no room, and none may be made.
        """
        try:
            self._keep_cap(take, part)
            free = shutil.disk_usage(self._folder).free
        except OSError as error:
            raise RecordError(f"[record] folder {self._folder}: {error.strerror}") from error
        if free < self._min_free_bytes:
            raise RecordError(
                f"[record] folder {self._folder}: {free / _MIB:.0f} MiB left on the disk, "
                f"min_free_mib is {self._min_free_bytes // _MIB}"
            )

    def drop_empty(self, take: Take, part: int) -> None:
        """Delete the files of a part into which nothing could be written; never raises."""
        for suffix in (".mcap", ".tlog"):
            path = take.part(part, suffix)
            with suppress(OSError):
                if path.stat().st_size == 0:
                    path.unlink()

    def _keep_cap(self, take: Take, part: int) -> None:
        current = {take.part(part, suffix).name for suffix in (".mcap", ".tlog")}
        files = [(path, path.stat()) for path in self._folder.iterdir() if _OURS.match(path.name)]
        total = sum(stat.st_size for _, stat in files)
        oldest_first = sorted(files, key=lambda entry: (entry[1].st_mtime_ns, entry[0].name))
        for path, stat in oldest_first:
            if total <= self._max_bytes:
                return
            if path.name in current:
                continue
            if not self._deletes:
                break
            path.unlink()
            total -= stat.st_size
        if total > self._max_bytes:
            raise RecordError(
                f"[record] folder {self._folder}: {total / _MIB:.0f} MiB of records, "
                f"max_total_mib is {self._max_bytes // _MIB}"
            )
