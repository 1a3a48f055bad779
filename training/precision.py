"""Arithmetic of the training step."""

from __future__ import annotations

import contextlib

import torch

from training.errors import TrainingSettingsError

PRECISIONS = ("auto", "fp32", "bf16")


def resolve_precision(wanted: str) -> str:
    """ "fp32" or "bf16". "auto" takes bf16 where the CPU computes it (AMX or AVX-512 BF16), else fp32.

    Without such units bf16 is emulated and slower than fp32.

    Raises:
        TrainingSettingsError: an unknown name.
    """
    if wanted not in PRECISIONS:
        raise TrainingSettingsError(f"precision is {wanted!r}: one of {', '.join(PRECISIONS)} is needed")
    if wanted != "auto":
        return wanted
    capabilities = torch.cpu.get_capabilities()
    return "bf16" if capabilities.get("amx_bf16") or capabilities.get("avx512_bf16") else "fp32"


def autocast(precision: str) -> contextlib.AbstractContextManager[object]:
    """Context in which convolutions run at the given precision."""
    if precision == "bf16":
        return torch.autocast("cpu", dtype=torch.bfloat16)
    return contextlib.nullcontext()
