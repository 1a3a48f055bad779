"""What ONNX Runtime can compute a network with: its own CPU code, CUDA, and plug-ins for Intel and NVIDIA."""

from __future__ import annotations

import importlib
import importlib.util
import json
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import onnxruntime

CPU_INFO = Path("/proc/cpuinfo")
BFLOAT16_FLAGS = frozenset({"avx512_bf16", "amx_bf16", "bf16"})
"""Flags of processors that multiply bfloat16: two of x86, one of ARM. Without them bf16 is the slower one."""

INT8_FLAGS = frozenset({"avx512_vnni", "avx_vnni", "amx_int8"})
"""Flags of x86 processors that multiply and add 8-bit numbers in one instruction."""

_NO_FALLBACK = "session.disable_cpu_ep_fallback"
"""Without this ONNX Runtime would silently run on its own what a plug-in does not take."""


class ProviderUnavailableError(Exception):
    """A provider cannot run this network here; the text says why."""


@dataclass(frozen=True)
class OpenedSession:
    """A session and the number format that it computes in, "fp32" or "bf16", unless the file says int8."""

    session: Any
    precision: str = "fp32"


@dataclass(frozen=True)
class ExecutionProvider:
    """One way to compute a network.

    Args:
        title: its name for people.
        extra: how it is installed.
        is_installed: whether its package is there, which says nothing about the hardware.
        open: loads an ONNX file with a number of threads (None: one for each core); raises
            `ProviderUnavailableError` or one of `runtime_errors`.
        prefers_int8: whether it was measured to be faster with a network's 8-bit file on such a machine.
    """

    title: str
    extra: str
    is_installed: Callable[[], bool]
    open: Callable[[Path, int | None], OpenedSession]
    prefers_int8: Callable[[], bool] = lambda: False


def session_options(threads: int | None) -> onnxruntime.SessionOptions:
    """Options that every provider gets."""
    import onnxruntime as ort

    options = ort.SessionOptions()
    options.log_severity_level = 3
    options.intra_op_num_threads = threads or 0
    options.inter_op_num_threads = 1
    # Idle inference threads must not spin: the camera and the MAVLink link share these cores.
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    # The arena keeps the largest footprint it ever had; without it the peak is given back.
    options.enable_cpu_mem_arena = False
    return options


def runtime_errors() -> tuple[type[Exception], ...]:
    """Every error that ONNX Runtime raises: its classes share no base but Exception."""
    from onnxruntime.capi import onnxruntime_pybind11_state as state

    own = [
        value for value in vars(state).values() if isinstance(value, type) and issubclass(value, Exception)
    ]
    return (*own, RuntimeError, ValueError)


def computes_bfloat16() -> bool:
    """Whether this processor has bfloat16 arithmetic, as far as Linux tells; False elsewhere."""
    return not BFLOAT16_FLAGS.isdisjoint(_processor_flags())


def computes_int8() -> bool:
    """Whether this processor has 8-bit arithmetic for networks, as far as Linux tells; False elsewhere."""
    return not INT8_FLAGS.isdisjoint(_processor_flags())


def _processor_flags() -> frozenset[str]:
    try:
        text = CPU_INFO.read_text(encoding="utf-8", errors="replace")
    except OSError:
        return frozenset()
    lines = (line.partition(":") for line in text.splitlines())
    flags = next((value for key, _, value in lines if key.strip() in ("flags", "Features")), "")
    return frozenset(flags.split())


# -- ONNX Runtime's own


def _open_cpu(path: Path, threads: int | None) -> OpenedSession:
    import onnxruntime as ort

    providers = ["CPUExecutionProvider"]
    return OpenedSession(ort.InferenceSession(str(path), session_options(threads), providers=providers))


def _has_cuda() -> bool:
    import onnxruntime as ort

    return "CUDAExecutionProvider" in ort.get_available_providers()


def _open_cuda(path: Path, threads: int | None) -> OpenedSession:
    import onnxruntime as ort

    if not _has_cuda():
        raise ProviderUnavailableError("this ONNX Runtime has no CUDA (pip install onnxruntime-gpu)")
    providers = ["CUDAExecutionProvider", "CPUExecutionProvider"]
    session = ort.InferenceSession(str(path), session_options(threads), providers=providers)
    # Without a driver or a GPU ONNX Runtime goes on with the CPU and only logs it.
    if session.get_providers()[0] != "CUDAExecutionProvider":
        raise ProviderUnavailableError("CUDA finds no usable GPU, driver or CUDA libraries")
    return OpenedSession(session)


# -- plug-ins


def _plugin_devices(module_name: str, extra: str, ep_name: str, kind: str) -> list[Any]:
    """The plug-in's devices of a kind ("CPU" or "GPU"); it is registered once a process.

    Raises:
        ProviderUnavailableError: it is not installed, or has no such device here.
    """
    import onnxruntime as ort

    try:
        plugin = importlib.import_module(module_name)
    except ImportError as error:
        raise ProviderUnavailableError(f"it is not installed (pip install {extra})") from error

    def devices() -> list[Any]:
        wanted = getattr(ort.OrtHardwareDeviceType, kind)
        return [
            item for item in ort.get_ep_devices() if item.ep_name == ep_name and item.device.type == wanted
        ]

    found = devices()
    if not found:
        ort.register_execution_provider_library(f"uavdepth_{module_name}", plugin.get_library_path())
        found = devices()
    if not found:
        raise ProviderUnavailableError(f"it offers no {kind} device on this machine")
    return found


def _open_openvino(path: Path, threads: int | None) -> OpenedSession:
    import onnxruntime as ort

    devices = _plugin_devices(_OPENVINO_MODULE, _OPENVINO_EXTRA, "OpenVINOExecutionProvider", "CPU")
    options = session_options(threads)
    options.add_session_config_entry(_NO_FALLBACK, "1")
    is_half = computes_bfloat16()
    config = {
        "PERFORMANCE_HINT": "LATENCY",
        "NUM_STREAMS": "1",
        "INFERENCE_PRECISION_HINT": "bf16" if is_half else "f32",
    }
    if threads is not None:
        config["INFERENCE_NUM_THREADS"] = str(threads)
    with _file_of({"CPU": config}) as file:
        options.add_provider_for_devices(devices, {"load_config": str(file)})
        return OpenedSession(ort.InferenceSession(str(path), options), "bf16" if is_half else "fp32")


def _open_tensorrt(path: Path, threads: int | None) -> OpenedSession:
    import onnxruntime as ort

    devices = _plugin_devices(_TENSORRT_MODULE, _TENSORRT_EXTRA, "NvTensorRTRTXExecutionProvider", "GPU")
    options = session_options(threads)
    options.add_session_config_entry(_NO_FALLBACK, "1")
    # One GPU: the plug-in takes a session's devices together, and a second one is of no use to one picture.
    options.add_provider_for_devices(devices[:1], {})
    return OpenedSession(ort.InferenceSession(str(path), options))


def _openvino_prefers_int8() -> bool:
    """Beside bfloat16 arithmetic (AMX) 8 bits are slower: 11.2 ms instead of 10.2 at 384x192, 25.8 instead of
    23.5 at 640x320 (two cores, 23 November 2026)."""
    return computes_int8() and not computes_bfloat16()


@contextmanager
def _file_of(content: dict[str, Any]) -> Iterator[Path]:
    """JSON in a file for as long as ONNX Runtime reads it."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "load_config.json"
        file.write_text(json.dumps(content), encoding="utf-8")
        yield file


def _is_there(module_name: str) -> Callable[[], bool]:
    return lambda: importlib.util.find_spec(module_name) is not None


_OPENVINO_MODULE, _OPENVINO_EXTRA = "onnxruntime_ep_openvino", "'uavdepth[openvino]'"
_TENSORRT_MODULE, _TENSORRT_EXTRA = "onnxruntime_ep_nv_tensorrt_rtx", "onnxruntime-ep-nv-tensorrt-rtx"

PROVIDERS = {
    "tensorrt": ExecutionProvider(
        "TensorRT for RTX", _TENSORRT_EXTRA, _is_there(_TENSORRT_MODULE), _open_tensorrt
    ),
    "cuda": ExecutionProvider("CUDA", "onnxruntime-gpu", _has_cuda, _open_cuda),
    "openvino": ExecutionProvider(
        "OpenVINO", _OPENVINO_EXTRA, _is_there(_OPENVINO_MODULE), _open_openvino, _openvino_prefers_int8
    ),
    "cpu": ExecutionProvider("ONNX Runtime's CPU code", "onnxruntime", lambda: True, _open_cpu),
}
"""By name, the fastest first where all of them run; the last one always does."""
