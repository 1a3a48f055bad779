"""What machine the figures are from."""

from __future__ import annotations

import os
import platform

from uavdepth.model.providers import CPU_INFO


def machine_name() -> str:
    """Processor, cores, system and Python in one line."""
    parts = (
        _processor(),
        f"{os.cpu_count()} cores",
        platform.system(),
        f"Python {platform.python_version()}",
    )
    return ", ".join(parts)


def _processor() -> str:
    """The processor's own name where Linux tells it, else its architecture."""
    try:
        lines = CPU_INFO.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        lines = []
    names = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(names, "") or platform.processor() or platform.machine()
