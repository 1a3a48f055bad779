"""What came from others and was not understood."""

from __future__ import annotations

import threading


class BadSamples:
    """Counts samples that were not what their key says; any thread may note one."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self.count = 0
        self.last = ""
        """What was wrong with the last of them."""

    def note(self, why: str) -> None:
        """Count one."""
        with self._lock:
            self.count += 1
            self.last = why
