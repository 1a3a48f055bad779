"""`uavdepth model check`: each problem by its name with what to do, or what the network is."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import pytest
from onnx import TensorProto, helper, numpy_helper
from typer.testing import CliRunner, Result

from service.model_command import model_app
from uavdepth.model.card import CARD_METADATA_KEY

CARD: dict[str, Any] = {
    "card_version": 2,
    "name": "red",
    "input_width": 64,
    "input_height": 32,
    "mean": [0, 0, 0],
    "std": [1, 1, 1],
    "output": "relative_inverse_depth",
    "input_name": "x",
    "output_name": "y",
}


def write_network(path: Path, card: dict[str, Any] | None, gain: float = 1.0) -> Path:
    """A network whose output is `gain` times the red channel."""
    constants = [
        numpy_helper.from_array(np.array([0], np.int64), "first"),
        numpy_helper.from_array(np.array(gain, np.float32), "gain"),
    ]
    nodes = [
        helper.make_node("Gather", ["x", "first"], ["red"], axis=1),
        helper.make_node("Mul", ["red", "gain"], ["y"]),
    ]
    picture = helper.make_tensor_value_info("x", TensorProto.FLOAT, [1, 3, 32, 64])
    depth = helper.make_tensor_value_info("y", TensorProto.FLOAT, [1, 1, 32, 64])
    graph = helper.make_graph(nodes, "red", [picture], [depth], constants)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)])
    model.ir_version = 8
    if card is not None:
        helper.set_model_props(model, {CARD_METADATA_KEY: json.dumps(card)})
    onnx.save(model, str(path))
    return path


def run_check(*words: str | Path) -> Result:
    options = ("--provider", "cpu", "--threads", "1")
    return CliRunner().invoke(model_app, ["check", *map(str, words), *options])


def test_a_whole_network_is_described_and_run(tmp_path: Path) -> None:
    result = run_check(write_network(tmp_path / "n.onnx", CARD))
    assert result.exit_code == 0
    for words in ("red, version 2", "64x32, rgb, nchw", "relative_inverse_depth, not metric", "cpu (fp32)"):
        assert words in result.output
    assert "ms for a picture of 640x320" in result.output
    assert "100.0% of the pixels" in result.output
    assert "units of its own" in result.output
    assert result.output.endswith("OK\n")


def test_the_card_may_lie_anywhere(tmp_path: Path) -> None:
    card = tmp_path / "my.toml"
    card.write_text("\n".join(f"{key} = {json.dumps(value)}" for key, value in CARD.items()))
    assert run_check(write_network(tmp_path / "n.onnx", None), "--card", card).exit_code == 0


@pytest.mark.parametrize(
    ("card", "gain", "problems"),
    [
        (None, 1.0, ["'uavdepth.card' is missing", "n.onnx.toml"]),
        ({**CARD, "std": [1, 1]}, 1.0, ["key 'std", "fix: std: Divides"]),
        (
            {**CARD, "heigth": 3, "output": "disparity"},
            1.0,
            ["unknown key 'heigth'", "take it out", "key 'output' is 'disparity'"],
        ),
        ({**CARD, "metric": True}, 1.0, ["has no metres"]),
        ({**CARD, "output_name": "depth"}, 1.0, ["output_name is 'depth'", "set output_name to one of them"]),
        (
            {**CARD, "input_name": "image", "output_name": "depth"},
            1.0,
            ["input_name is 'image'", "output_name is 'depth'"],
        ),
        ({**CARD, "input_width": 128}, 1.0, ["[1, 3, 32, 128], the network's is [1, 3, 32, 64]"]),
        (CARD, float("nan"), ["no pixel of the answer is a usable number"]),
        ({**CARD, "output": "affine_inverse_depth"}, 0.0, ["two different pictures get the same answer"]),
    ],
)
def test_each_problem_stands_on_a_line_with_its_fix(
    tmp_path: Path, card: dict[str, Any] | None, gain: float, problems: list[str]
) -> None:
    result = run_check(write_network(tmp_path / "n.onnx", card, gain))
    assert result.exit_code == 1
    lines = result.output.splitlines()
    told = [number for number, line in enumerate(lines) if line.startswith("PROBLEM ")]
    assert told
    assert all(lines[number + 1].startswith("    fix: ") for number in told)
    for problem in problems:
        assert problem in result.output
    assert "OK" not in lines


@pytest.mark.parametrize("content", [None, b"", b"not a network"])
def test_a_file_that_is_no_network_is_told(tmp_path: Path, content: bytes | None) -> None:
    path = tmp_path / "n.onnx"
    if content is not None:
        path.write_bytes(content)
    result = run_check(path)
    assert result.exit_code == 1
    assert f"PROBLEM {path}" in result.output
