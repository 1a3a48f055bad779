"""The configured network inside the pipeline: its hints, and what the log says of it."""

from __future__ import annotations

import json
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import onnx
import pytest
from hinted_pipeline import AHEAD, CAMERA, SECOND, at, frame_at
from onnx import TensorProto, helper, numpy_helper
from program_fakes import FLYING_HEIGHT_M, make_settings
from structlog.testing import capture_logs

from service.pipeline import Perception
from uavdepth.model.card import CARD_METADATA_KEY
from uavdepth.model.providers import PROVIDERS, OpenedSession, ProviderUnavailableError
from uavdepth.scan.obstacle_scan import SectorState


def write_hinted_network(path: Path) -> Path:
    """A network that answers with the ground it is told, and 30 m where there is none."""
    width, height, focal_px = 64, 32, 50.0
    card = {
        "card_version": 2,
        "name": "ground",
        "input_width": width,
        "input_height": height,
        "mean": [0, 0, 0],
        "std": [1, 1, 1],
        "output": "inverse_depth",
        "metric": True,
        "uncertainty": True,
        "focal_px": focal_px,
        "max_depth_m": 100.0,
        "hints": ["ground"],
        "output_name": "inverse",
    }
    constants = [
        numpy_helper.from_array(np.array([0], np.int64), "first"),
        numpy_helper.from_array(np.array(0.0, np.float32), "zero"),
        numpy_helper.from_array(np.array(-2.0, np.float32), "sigma"),
        numpy_helper.from_array(
            np.array(CAMERA.fx * width / CAMERA.width / focal_px / 30, np.float32), "far"
        ),
    ]
    nodes = [
        helper.make_node("Gather", ["image", "first"], ["red"], axis=1),
        helper.make_node("Mul", ["red", "zero"], ["nothing"]),
        helper.make_node("Max", ["ground", "far"], ["nearer"]),
        helper.make_node("Add", ["nearer", "nothing"], ["inverse"]),
        helper.make_node("Add", ["nothing", "sigma"], ["log_sigma"]),
    ]
    inputs = [
        helper.make_tensor_value_info(name, TensorProto.FLOAT, [1, channels, height, width])
        for name, channels in (("image", 3), ("ground", 1))
    ]
    outputs = [
        helper.make_tensor_value_info(name, TensorProto.FLOAT, [1, 1, height, width])
        for name in ("inverse", "log_sigma")
    ]
    model = helper.make_model(
        helper.make_graph(nodes, "ground", inputs, outputs, constants),
        opset_imports=[helper.make_opsetid("", 17)],
    )
    model.ir_version = 8
    helper.set_model_props(model, {CARD_METADATA_KEY: json.dumps(card)})
    onnx.save(model, str(path))
    return path


def test_a_configured_network_with_hints_measures_in_metres(tmp_path: Path) -> None:
    path = write_hinted_network(tmp_path / "ground.onnx")
    perception = Perception.load(make_settings(f"model.path={path}", "model.provider=cpu"))
    result = perception.step(frame_at(1.0), at(SECOND))
    assert result.trusted
    assert result.depth is not None
    row = CAMERA.height - 1
    down = CAMERA.normalized_rays[row, 0, 1]
    # The network's rows are three of the camera's high.
    assert result.depth.depth_m[row, 0] == pytest.approx(FLYING_HEIGHT_M / down, rel=0.05)
    assert result.depth.depth_m[0, 0] == pytest.approx(30.0, rel=1e-3)
    assert result.scan.state[AHEAD] == SectorState.CLEAR


def test_the_log_says_what_runs_the_network_and_once_why_not_something_faster(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(path: Path, threads: int | None) -> OpenedSession:
        raise ProviderUnavailableError("it offers no GPU device on this machine")

    for name in ("tensorrt", "cuda", "openvino"):
        is_there = name == "tensorrt"
        changed = replace(PROVIDERS[name], is_installed=lambda is_there=is_there: is_there, open=refuse)
        monkeypatch.setitem(PROVIDERS, name, changed)
    path = write_hinted_network(tmp_path / "ground.onnx")
    with capture_logs() as entries, warnings.catch_warnings():
        warnings.simplefilter("error")
        Perception.load(make_settings(f"model.path={path}"))
    (said,) = (entry for entry in entries if entry["event"] == "network")
    assert (said["name"], said["provider"], said["precision"]) == ("ground", "cpu", "fp32")
    (warned,) = (entry for entry in entries if entry["log_level"] == "warning")
    assert "TensorRT for RTX cannot be used: it offers no GPU" in warned["why"]
