"""ONNX Runtime: one session on one execution provider."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, get_args

from uavdepth.errors import ModelFileError, ProviderFallbackWarning
from uavdepth.model.providers import PROVIDERS, ProviderUnavailableError, runtime_errors

Provider = Literal["auto", "tensorrt", "cuda", "openvino", "cpu"]
"""auto: the first of the others that is installed and takes the network."""


@dataclass(frozen=True)
class InferenceSession:
    """A loaded network.

    Args:
        session: the `onnxruntime.InferenceSession`.
        provider: "tensorrt", "cuda", "openvino" or "cpu": the one that really runs it.
        precision: number format that it computes in, "fp32" or "bf16".
        fallback_reason: why "auto" did not take a better provider that is installed, or None.
    """

    session: Any
    provider: str
    precision: str = "fp32"
    fallback_reason: str | None = None


def open_session(path: Path, provider: str, threads: int | None) -> InferenceSession:
    """Load an ONNX file.

    Args:
        path: the file.
        provider: "auto" or the name of one of `PROVIDERS`.
        threads: threads for inference; None: one for each core.

    Raises:
        ModelFileError: no such file, not an ONNX network, an unknown provider, threads below 1, or a
            provider asked for by name that is missing or refuses the network.

    Warns:
        ProviderFallbackWarning: once, where "auto" ends with a slower provider than those installed.
    """
    if provider not in get_args(Provider):
        raise ModelFileError(f"provider is {provider!r}: one of {', '.join(get_args(Provider))} is needed")
    if threads is not None and threads < 1:
        raise ModelFileError(f"threads is {threads}: at least 1 is needed")
    if not path.is_file():
        raise ModelFileError(f"{path}: no such network file")
    if provider != "auto":
        try:
            return _open(provider, path, threads)
        except ProviderUnavailableError as error:
            raise ModelFileError(f"{path}: {error}") from error
    reasons = []
    for name, candidate in PROVIDERS.items():
        if not candidate.is_installed():
            continue
        try:
            opened = _open(name, path, threads)
        except ProviderUnavailableError as error:
            reasons.append(str(error))
            continue
        if not reasons:
            return opened
        reason = "; ".join(reasons)
        title = PROVIDERS[name].title
        warnings.warn(f"{path.name} runs on {title}: {reason}", ProviderFallbackWarning, stacklevel=3)
        return InferenceSession(opened.session, name, opened.precision, reason)
    raise ModelFileError(f"{path}: {reasons[-1]}")


def _open(name: str, path: Path, threads: int | None) -> InferenceSession:
    """The session; a failure of ONNX Runtime becomes `ProviderUnavailableError`, with the provider's name."""
    provider = PROVIDERS[name]
    try:
        opened = provider.open(path, threads)
    except ProviderUnavailableError as error:
        raise ProviderUnavailableError(f"{provider.title} cannot be used: {error}") from error
    except runtime_errors() as error:
        raise ProviderUnavailableError(f"{provider.title} cannot load it: {_first_line(error)}") from error
    return InferenceSession(opened.session, name, opened.precision)


def _first_line(error: Exception) -> str:
    return (str(error).strip() or type(error).__name__).splitlines()[0]
