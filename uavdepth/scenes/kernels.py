"""How the renderer's loops are compiled."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba import njit

_FREEDOM = {"contract", "reassoc", "nsz", "arcp"}
"""Floating-point freedom: everything but assuming that inf and NaN do not exist."""


def kernel(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a loop over arrays with Numba at its first call, one thread, without the GIL.

    The compiled code is kept on disk. Numba watches only the file that the function itself stands in: after
    a change of a kernel that others call, or of a constant of another file, touch the files that use it.
    """
    compiled: Callable[..., Any] = njit(cache=True, nogil=True, fastmath=_FREEDOM, error_model="numpy")(
        function
    )
    return compiled
