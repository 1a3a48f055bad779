"""Memory that was freed, given back to the system."""

from __future__ import annotations

import ctypes
import sys


def trim_heap() -> None:
    """Return freed memory to the system, where the C library is glibc, which otherwise keeps it.

    Painting textures and building a world leave some 50 MiB behind that nobody uses.
    """
    if sys.platform != "linux":
        return
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
    if trim is not None:
        trim(0)
