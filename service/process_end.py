"""The end of the process, with threads that a library does not give back."""

from __future__ import annotations

import os
import sys
import threading
from typing import NoReturn

STUCK_PREFIX = "zenoh-"
"""Threads that close sessions; where a peer accepts and stays silent that takes Zenoh many seconds."""


def end_process(code: int) -> NoReturn:
    """End with `code`, at once where a thread is still inside Zenoh.

    A thread that comes back from there into an interpreter that is being taken down aborts the process:
    "FATAL: exception not rethrown", exit code 134.
    """
    if any(thread.name.startswith(STUCK_PREFIX) for thread in threading.enumerate()):
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)
    sys.exit(code)
