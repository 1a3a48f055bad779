"""Power cuts take no more than crashes: the disk is asked to keep what the system has."""

from __future__ import annotations

import os
import threading
from pathlib import Path

from service.latest_slot import LatestSlot


class DiskSync:
    """Waits for the disk in a thread of its own: a card that takes seconds keeps nobody from writing on."""

    def __init__(self) -> None:
        self.error: OSError | None = None
        """The first thing that went wrong."""
        self._paths: LatestSlot[Path] = LatestSlot()
        self._thread = threading.Thread(target=self._run, name="recorder-sync", daemon=True)

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def ask(self, path: Path) -> None:
        """Make this file the next to be kept. Never waits."""
        self._paths.put(path)

    def stop(self, timeout_s: float) -> None:
        """End when what was asked for last is done, or leave the thread to itself after `timeout_s`."""
        self._paths.close()
        if self._thread.is_alive():
            self._thread.join(timeout_s)

    def _run(self) -> None:
        while (path := self._paths.take(None)) is not None:
            try:
                _sync(path)
            except FileNotFoundError:
                continue  # an old part that had to make room
            except OSError as error:
                self.error = self.error or error


def _sync(path: Path) -> None:
    # A descriptor of its own: the writer may close the file meanwhile.
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
