"""Which provider runs a network: the best that is installed and works; a word where that is a lesser one."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from onnx_files import card_values, write_red_network

from uavdepth import ModelFileError
from uavdepth.errors import ProviderFallbackWarning
from uavdepth.model import providers
from uavdepth.model.inference import open_session
from uavdepth.model.providers import (
    PROVIDERS,
    ProviderUnavailableError,
    computes_bfloat16,
    computes_int8,
)

open_cpu = PROVIDERS["cpu"].open


@pytest.fixture
def network(tmp_path: Path) -> Path:
    return write_red_network(tmp_path / "net.onnx", card_values())


@pytest.fixture
def machine(monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """A machine with the providers named; their value is what opening them does, or the error it ends in."""

    def make(**installed: Any) -> None:
        for name, provider in PROVIDERS.items():
            if name == "cpu":
                continue
            act = installed.get(name)

            def opening(path: Path, threads: int | None, act: Any = act) -> Any:
                if isinstance(act, Exception):
                    raise act
                return open_cpu(path, threads)

            is_there = name in installed
            changed = replace(provider, is_installed=lambda is_there=is_there: is_there, open=opening)
            monkeypatch.setitem(PROVIDERS, name, changed)

    return make


@pytest.mark.parametrize(
    ("installed", "expected"),
    [
        ((), "cpu"),
        (("openvino",), "openvino"),
        (("openvino", "cuda"), "cuda"),
        (("openvino", "cuda", "tensorrt"), "tensorrt"),
    ],
)
def test_auto_takes_the_best_that_is_installed_without_a_word(
    machine: Callable[..., None], network: Path, installed: tuple[str, ...], expected: str
) -> None:
    machine(**dict.fromkeys(installed, "works"))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        session = open_session(network, "auto", 1)
    assert session.provider == expected
    assert session.fallback_reason is None


def test_auto_falls_back_with_one_warning_that_names_what_failed_and_what_runs(
    machine: Callable[..., None], network: Path
) -> None:
    machine(
        tensorrt=ProviderUnavailableError("it offers no GPU device on this machine"),
        cuda=RuntimeError("no driver\nand a long stack"),
        openvino="works",
    )
    with pytest.warns(ProviderFallbackWarning) as caught:
        session = open_session(network, "auto", 1)
    assert len(caught) == 1
    assert session.provider == "openvino"
    assert session.fallback_reason is not None
    for part in ("TensorRT for RTX cannot be used: it offers no GPU", "CUDA cannot load it: no driver"):
        assert part in session.fallback_reason
        assert part in str(caught[0].message)
    assert "net.onnx runs on OpenVINO" in str(caught[0].message)
    assert "stack" not in session.fallback_reason


def test_a_provider_asked_for_by_name_is_taken_or_refused_never_replaced(
    machine: Callable[..., None], network: Path
) -> None:
    machine(openvino="works", cuda=ProviderUnavailableError("no GPU"))
    assert open_session(network, "openvino", 1).provider == "openvino"
    assert open_session(network, "cpu", 1).provider == "cpu"
    with pytest.raises(ModelFileError, match=r"net\.onnx: CUDA cannot be used: no GPU"):
        open_session(network, "cuda", 1)


@pytest.mark.parametrize("provider", ["tensorrt", "openvino"])
def test_a_plug_in_that_is_not_installed_says_how_to_get_it(
    monkeypatch: pytest.MonkeyPatch, network: Path, provider: str
) -> None:
    def missing(name: str) -> Any:
        raise ModuleNotFoundError(f"No module named {name!r}")

    monkeypatch.setattr(providers.importlib, "import_module", missing)
    with pytest.raises(ModelFileError, match=r"it is not installed \(pip install"):
        open_session(network, provider, 1)


def test_a_broken_file_is_an_error_and_no_fallback(machine: Callable[..., None], tmp_path: Path) -> None:
    machine(openvino=RuntimeError("cannot parse"))
    path = tmp_path / "broken.onnx"
    path.write_bytes(b"not a network")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(ModelFileError, match=r"broken\.onnx: ONNX Runtime's CPU code cannot load it"):
            open_session(path, "auto", 1)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("flags\t\t: fpu avx512f avx512_bf16 sse\n", True),
        ("flags : avx512f amx_bf16 amx_tile\n", True),
        ("processor : 0\nFeatures : fp asimd bf16 i8mm\n", True),
        ("flags\t\t: fpu avx512f avx512_vnni\nbugs : bf16\n", False),
        ("", False),
    ],
)
def test_bfloat16_is_used_where_the_processor_multiplies_it(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, text: str, expected: bool
) -> None:
    info = tmp_path / "cpuinfo"
    info.write_text(text)
    monkeypatch.setattr(providers, "CPU_INFO", info)
    assert computes_bfloat16() is expected


def test_without_word_of_the_processor_bfloat16_is_not_used(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(providers, "CPU_INFO", tmp_path / "gone")
    assert computes_bfloat16() is False


@pytest.mark.parametrize(
    ("flags", "expected"),
    [
        ("avx512f avx512_vnni", True),
        ("avx2 avx_vnni", True),
        ("avx2 fma", False),
        # 8 bits compute there too, but beside bfloat16 nobody measured which is faster.
        ("avx512_vnni avx512_bf16", False),
        ("amx_int8 amx_bf16", False),
    ],
)
def test_openvino_is_given_8_bits_where_the_processor_has_them_and_no_bfloat16(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, flags: str, expected: bool
) -> None:
    info = tmp_path / "cpuinfo"
    info.write_text(f"flags\t\t: fpu {flags} sse\n")
    monkeypatch.setattr(providers, "CPU_INFO", info)
    assert computes_int8() == ("vnni" in flags or "int8" in flags)
    assert PROVIDERS["openvino"].prefers_int8() is expected
    assert not any(PROVIDERS[name].prefers_int8() for name in ("cpu", "cuda", "tensorrt"))
