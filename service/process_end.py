"""The end of the process, with threads that a library does not give back."""

from __future__ import annotations

import os
import sys
import threading
from contextlib import suppress
from typing import NoReturn

_STUCK = ("zenoh-", "camera", "side ", "perception", "recorder")
"""Beginnings of the names of threads that wait inside libraries: a Zenoh session whose peer accepts and stays
silent takes many seconds to close, as do a camera, a world to be rendered, a network and a disk that hang."""


def end_process(code: int) -> NoReturn:
    """End with `code`, at once where such a thread is still there or Zenoh was used.

    A thread that comes back from its library into an interpreter that is being taken down aborts the process
    ("FATAL: exception not rethrown", "terminate called without an active exception", exit code 134). Zenoh's
    own threads, which Python does not know, do so now and then when they let go of what they called.
    """
    is_stuck = any(thread.name.startswith(_STUCK) for thread in threading.enumerate())
    if is_stuck or "zenoh" in sys.modules:
        for stream in (sys.stdout, sys.stderr):
            with suppress(OSError):  # nobody reads it any more
                stream.flush()
        os._exit(code)
    sys.exit(code)
