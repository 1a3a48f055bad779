"""A file that remembers what went wrong with it."""

from __future__ import annotations

import os
from io import BufferedWriter
from pathlib import Path


class DiskFile:
    """A new file for a writer that may swallow errors: the MCAP writer reports a full disk to its log only.

    Args:
        path: where; nothing is overwritten.

    Raises:
        OSError: it exists already, or cannot be made.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.error: OSError | None = None
        """The first thing that went wrong while writing."""
        self._end = 0
        self._file: BufferedWriter = path.open("xb")

    @property
    def size(self) -> int:
        """Bytes handed over so far."""
        return self._end

    def write(self, data: bytes) -> int:
        """Write; an error is remembered and raised."""
        try:
            written = self._file.write(data)
            self._end = max(self._end, self._file.tell())
        except OSError as error:
            self.error = self.error or error
            raise
        return written

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        """Move; an error is remembered and raised."""
        try:
            return self._file.seek(offset, whence)
        except OSError as error:
            self.error = self.error or error
            raise

    def tell(self) -> int:
        """Where the next byte goes."""
        return self._file.tell()

    def flush(self) -> None:
        """Hand everything to the system; an error is remembered and raised."""
        try:
            self._file.flush()
        except OSError as error:
            self.error = self.error or error
            raise

    def close(self) -> None:
        """Close; may be called twice. An error is remembered."""
        try:
            self._file.close()
        except OSError as error:
            self.error = self.error or error
            # The buffer cannot be written: let go of the descriptor at least.
            self._file.raw.close()
