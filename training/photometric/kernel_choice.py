"""Which arithmetic a picture gets: compiled loops on a processor, torch elsewhere."""

from __future__ import annotations

from functools import cache
from types import ModuleType
from typing import Any

import torch
from torch import Tensor


def kernels_for(picture: Tensor) -> ModuleType | None:
    """The compiled loops for single precision on a processor, else None."""
    return _kernels() if picture.device.type == "cpu" and picture.dtype == torch.float32 else None


def planes(values: Tensor) -> Any:
    """The numbers as a contiguous array without a gradient."""
    return values.detach().contiguous().numpy()


@cache
def _kernels() -> ModuleType | None:
    """None without Numba: torch then does the same work in some six times the time."""
    try:
        from training.photometric import kernels
    except ImportError:
        return None
    return kernels
