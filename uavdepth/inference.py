"""ONNX Runtime: one session on one execution provider."""

from __future__ import annotations

import json
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, get_args

from uavdepth.errors import ModelFileError

if TYPE_CHECKING:
    import onnxruntime

Provider = Literal["auto", "cpu", "openvino"]
"""auto: OpenVINO where its plug-in is installed and takes the network, else ONNX Runtime's own CPU code."""

_OPENVINO_PROVIDER = "OpenVINOExecutionProvider"

_OPENVINO_LIBRARY = "uavdepth_openvino"
"""Name under which the plug-in is registered with ONNX Runtime, once a process."""


@dataclass(frozen=True)
class InferenceSession:
    """A loaded network.

    Args:
        session: the `onnxruntime.InferenceSession`.
        provider: "cpu" or "openvino", the one that really runs it.
        fallback_reason: why "auto" did not take OpenVINO, or None.
    """

    session: Any
    provider: str
    fallback_reason: str | None = None


def open_session(path: Path, provider: str, threads: int | None) -> InferenceSession:
    """Load an ONNX file.

    Args:
        path: the file.
        provider: "auto", "cpu" or "openvino".
        threads: threads for inference; None: one for each core.

    Raises:
        ModelFileError: no such file, not an ONNX network, an unknown provider, threads below 1, or
            "openvino" asked for where the plug-in is missing or refuses the network.
    """
    if provider not in get_args(Provider):
        raise ModelFileError(f"provider is {provider!r}: one of {', '.join(get_args(Provider))} is needed")
    if threads is not None and threads < 1:
        raise ModelFileError(f"threads is {threads}: at least 1 is needed")
    if not path.is_file():
        raise ModelFileError(f"{path}: no such network file")

    reason = None
    if provider in ("auto", "openvino"):
        try:
            return InferenceSession(_openvino_session(path, threads), "openvino")
        except _OpenVinoUnavailableError as error:
            if provider == "openvino":
                raise ModelFileError(f"{path}: {error}") from error
            reason = str(error)
    return InferenceSession(_cpu_session(path, threads), "cpu", reason)


class _OpenVinoUnavailableError(Exception):
    """OpenVINO cannot run this network here; the text says why."""


def _cpu_session(path: Path, threads: int | None) -> Any:
    import onnxruntime as ort

    try:
        return ort.InferenceSession(str(path), _options(ort, threads), providers=["CPUExecutionProvider"])
    except _runtime_errors() as error:
        raise ModelFileError(f"{path}: ONNX Runtime cannot load it: {_first_line(error)}") from error


def _options(ort: Any, threads: int | None) -> onnxruntime.SessionOptions:
    options = ort.SessionOptions()
    options.log_severity_level = 3
    options.intra_op_num_threads = threads or 0
    options.inter_op_num_threads = 1
    # Idle inference threads must not spin: the camera and the MAVLink link share these cores.
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    # The arena keeps the largest footprint it ever had; without it the peak is given back.
    options.enable_cpu_mem_arena = False
    return options


def _openvino_session(path: Path, threads: int | None) -> Any:
    import onnxruntime as ort

    try:
        import onnxruntime_ep_openvino as plugin
    except ImportError as error:
        raise _OpenVinoUnavailableError(
            "the OpenVINO plug-in is not installed (pip install 'uavdepth[openvino]')"
        ) from error
    try:
        devices = _openvino_cpu_devices(ort)
        if not devices:
            ort.register_execution_provider_library(_OPENVINO_LIBRARY, plugin.get_library_path())
            devices = _openvino_cpu_devices(ort)
        if not devices:
            raise _OpenVinoUnavailableError("the OpenVINO plug-in offers no CPU device")
        options = _options(ort, threads)
        # Without this ONNX Runtime would silently run on its own what OpenVINO does not take.
        options.add_session_config_entry("session.disable_cpu_ep_fallback", "1")
        with tempfile.TemporaryDirectory() as folder:
            options.add_provider_for_devices(devices, _openvino_options(Path(folder), threads))
            return ort.InferenceSession(str(path), options)
    except _runtime_errors() as error:
        raise _OpenVinoUnavailableError(f"OpenVINO cannot run it: {_first_line(error)}") from error


def _openvino_cpu_devices(ort: Any) -> list[Any]:
    return [
        device
        for device in ort.get_ep_devices()
        if device.ep_name == _OPENVINO_PROVIDER and device.device.type == ort.OrtHardwareDeviceType.CPU
    ]


def _openvino_options(folder: Path, threads: int | None) -> dict[str, str]:
    config: dict[str, Any] = {"PERFORMANCE_HINT": "LATENCY", "NUM_STREAMS": "1"}
    if threads is not None:
        config["INFERENCE_NUM_THREADS"] = str(threads)
    file = folder / "openvino.json"
    file.write_text(json.dumps({"CPU": config}), encoding="utf-8")
    return {"load_config": str(file)}


def _runtime_errors() -> tuple[type[Exception], ...]:
    """Every error that ONNX Runtime raises: its classes share no base but Exception."""
    from onnxruntime.capi import onnxruntime_pybind11_state as state

    own = [
        value for value in vars(state).values() if isinstance(value, type) and issubclass(value, Exception)
    ]
    return (*own, RuntimeError, ValueError)


def _first_line(error: Exception) -> str:
    return (str(error).strip() or type(error).__name__).splitlines()[0]
