"""What tests need that run beside each other: `make test` runs most in two processes."""

from __future__ import annotations

import os
from pathlib import Path

# Before numpy and torch are imported. The tests' networks are small: threads would wait longer than compute.
os.environ.setdefault("OMP_NUM_THREADS", "1")

WORKER = os.environ.get("PYTEST_XDIST_WORKER")
if WORKER is not None:
    # Numba's files on disk are not meant for two processes that compile the same loop at the same time.
    cache = Path(__file__).parents[1] / ".pytest_cache" / "numba" / WORKER
    os.environ.setdefault("NUMBA_CACHE_DIR", str(cache))
