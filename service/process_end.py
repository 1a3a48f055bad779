"""The end of the process, with threads that a library does not give back."""

from __future__ import annotations

import os
import sys
import threading
from typing import NoReturn

_STUCK = ("zenoh-", "camera", "side ", "perception", "recorder")
"""Beginnings of the names of threads that wait inside libraries: a Zenoh session whose peer accepts and stays
silent takes many seconds to close, as do a camera, a world to be rendered, a network and a disk that hang."""


def end_process(code: int) -> NoReturn:
    """End with `code`, at once where such a thread is still there.

    One that comes back from its library into an interpreter that is being taken down aborts the process
    ("FATAL: exception not rethrown", "terminate called without an active exception", exit code 134).
    """
    if any(thread.name.startswith(_STUCK) for thread in threading.enumerate()):
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)
    sys.exit(code)
