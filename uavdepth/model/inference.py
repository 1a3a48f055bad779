"""ONNX Runtime: one session on one execution provider."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, get_args

from uavdepth.errors import ModelFileError, ProviderFallbackWarning
from uavdepth.model.int8_file import digest, int8_beside, source_digest
from uavdepth.model.providers import PROVIDERS, ProviderUnavailableError, runtime_errors

Provider = Literal["auto", "tensorrt", "cuda", "openvino", "cpu"]
"""auto: the first of the others that is installed and takes the network."""

Precision = Literal["auto", "float", "int8"]
"""auto: the network's 8-bit file where there is one and the provider is faster with it; int8: always that;
float: never, but bfloat16 where the processor computes it."""


@dataclass(frozen=True)
class InferenceSession:
    """A loaded network.

    Args:
        session: the `onnxruntime.InferenceSession`.
        provider: "tensorrt", "cuda", "openvino" or "cpu": the one that really runs it.
        precision: number format that it computes in, "fp32", "bf16" or "int8".
        fallback_reason: why "auto" did not take what would be faster and is there, or None.
    """

    session: Any
    provider: str
    precision: str = "fp32"
    fallback_reason: str | None = None


def open_session(path: Path, provider: str, threads: int | None, precision: str = "auto") -> InferenceSession:
    """Load an ONNX file.

    Args:
        path: the file.
        provider: "auto" or the name of one of `PROVIDERS`.
        threads: threads for inference; None: one for each core.
        precision: "auto", "float" or "int8".

    Raises:
        ModelFileError: no such file, not an ONNX network, an unknown provider or precision, threads below
            1, an 8-bit file asked for by name that is missing or was made from another network, or a
            provider asked for by name that is missing or refuses the network.

    Warns:
        ProviderFallbackWarning: once, where "auto" ends with something slower than what is installed.
    """
    _check_word("provider", provider, get_args(Provider))
    _check_word("precision", precision, get_args(Precision))
    if threads is not None and threads < 1:
        raise ModelFileError(f"threads is {threads}: at least 1 is needed")
    if not path.is_file():
        raise ModelFileError(f"{path}: no such network file")
    if precision == "int8" and not int8_beside(path).is_file():
        raise ModelFileError(
            f"precision is 'int8': there is no {int8_beside(path).name} beside {path}; "
            "`uavdepth quantize` makes one, 'float' or 'auto' goes without"
        )
    reasons = []
    for name, is_int8 in _ways(path, provider, precision):
        try:
            opened = _open_int8(name, path, threads) if is_int8 else _open(name, path, threads)
        except ProviderUnavailableError as error:
            reasons.append(str(error))
            continue
        if not reasons:
            return opened
        reason = "; ".join(reasons)
        how = f"{PROVIDERS[name].title} in {opened.precision}"
        warnings.warn(f"{path.name} runs on {how}: {reason}", ProviderFallbackWarning, stacklevel=3)
        return replace(opened, fallback_reason=reason)
    raise ModelFileError(f"{path}: {reasons[-1]}")


def _check_word(key: str, value: str, allowed: tuple[str, ...]) -> None:
    if value not in allowed:
        raise ModelFileError(f"{key} is {value!r}: one of {', '.join(allowed)} is needed")


def _ways(path: Path, provider: str, precision: str) -> Iterator[tuple[str, bool]]:
    """Providers, and whether with the 8-bit file, in the order to try them in."""
    for name, candidate in PROVIDERS.items():
        if name != provider and (provider != "auto" or not candidate.is_installed()):
            continue
        if precision == "int8":
            yield name, True
            continue
        if precision == "auto" and candidate.prefers_int8() and int8_beside(path).is_file():
            yield name, True
        yield name, False


def _open(name: str, path: Path, threads: int | None) -> InferenceSession:
    """The session; a failure of ONNX Runtime becomes `ProviderUnavailableError`, with the provider's name."""
    provider = PROVIDERS[name]
    try:
        opened = provider.open(path, threads)
    except ProviderUnavailableError as error:
        raise ProviderUnavailableError(f"{provider.title} cannot be used: {error}") from error
    except runtime_errors() as error:
        raise ProviderUnavailableError(f"{provider.title} cannot load it: {_first_line(error)}") from error
    is_int8 = source_digest(opened.session) is not None
    return InferenceSession(opened.session, name, "int8" if is_int8 else opened.precision)


def _open_int8(name: str, path: Path, threads: int | None) -> InferenceSession:
    """The session of a network's 8-bit file."""
    file = int8_beside(path)
    try:
        inference = _open(name, file, threads)
    except ProviderUnavailableError as error:
        raise ProviderUnavailableError(f"{file.name}: {error}") from error
    if source_digest(inference.session) != digest(path):
        raise ProviderUnavailableError(
            f"{file.name} was not made from this network: make it anew with `uavdepth quantize`"
        )
    return inference


def _first_line(error: Exception) -> str:
    return (str(error).strip() or type(error).__name__).splitlines()[0]
