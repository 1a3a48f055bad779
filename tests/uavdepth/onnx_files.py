"""Small ONNX networks with known answers, in place of trained weights."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

from uavdepth.model.card import CARD_METADATA_KEY
from uavdepth.model.int8_file import SOURCE_METADATA_KEY, digest

WIDTH, HEIGHT = 48, 32
MEAN, STD = [0.485, 0.456, 0.406], [0.229, 0.224, 0.225]


def card_values(**changes: Any) -> dict[str, Any]:
    """A complete card as a dict; a change to None takes the key away."""
    values: dict[str, Any] = {
        "card_version": 1,
        "name": "test network",
        "input_width": WIDTH,
        "input_height": HEIGHT,
        "mean": MEAN,
        "std": STD,
        "output": "log_inverse_depth",
        "metric": True,
        "uncertainty": False,
        "focal_px": 40.0,
        "max_depth_m": 100.0,
        "training_data": "none",
        "licence": "Apache-2.0",
        "measured": {"abs_rel": 0.1},
        "created": "2026-11-22T00:00:00Z",
    }
    values.update(changes)
    return {key: value for key, value in values.items() if value is not None}


def write_toml_card(path: Path, values: dict[str, Any]) -> Path:
    """A card as a TOML file; TOML writes simple values as JSON does, and tables under their names."""
    tables = {key: value for key, value in values.items() if isinstance(value, dict)}
    lines = [f"{key} = {json.dumps(value)}" for key, value in values.items() if key not in tables]
    for key, table in tables.items():
        lines += [f"[{key}]", *(f"{name} = {json.dumps(value)}" for name, value in table.items())]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def write_red_network(
    path: Path,
    card: dict[str, Any] | None,
    *,
    uncertainty: float | None = None,
    width: int = WIDTH,
    height: int = HEIGHT,
    gain: float = 1.0,
    int8_of: Path | None = None,
    halved: bool = False,
) -> Path:
    """A network whose output is `gain` times its normalised red channel, log sigma a constant.

    Args:
        path: the file to write.
        card: the card to put into the metadata, or None for none.
        uncertainty: log of relative sigma, or None for a network without that output.
        width, height: size of the graph's input.
        int8_of: the network that its metadata says it is the 8-bit file of.
        halved: outputs of half the input's size, the mean of four pixels each.
    """
    picture = helper.make_tensor_value_info("image", TensorProto.FLOAT, [1, 3, height, width])
    size = [1, 1, height // 2, width // 2] if halved else [1, 1, height, width]
    depth = helper.make_tensor_value_info("log_inverse_depth", TensorProto.FLOAT, size)
    constants = [
        numpy_helper.from_array(np.array([0], dtype=np.int64), "first"),
        numpy_helper.from_array(np.array([gain], dtype=np.float32), "gain"),
    ]
    nodes = [
        helper.make_node("Gather", ["image", "first"], ["red pixels"], axis=1),
        helper.make_node("AveragePool", ["red pixels"], ["red"], kernel_shape=[2, 2], strides=[2, 2])
        if halved
        else helper.make_node("Identity", ["red pixels"], ["red"]),
        helper.make_node("Mul", ["red", "gain"], ["log_inverse_depth"]),
    ]
    outputs = [depth]
    if uncertainty is not None:
        constants += [
            numpy_helper.from_array(np.array([0.0], dtype=np.float32), "zero"),
            numpy_helper.from_array(np.array([uncertainty], dtype=np.float32), "sigma"),
        ]
        nodes += [
            helper.make_node("Mul", ["red", "zero"], ["nothing"]),
            helper.make_node("Add", ["nothing", "sigma"], ["log_sigma"]),
        ]
        outputs.append(helper.make_tensor_value_info("log_sigma", TensorProto.FLOAT, size))
    graph = helper.make_graph(nodes, "red", [picture], outputs, constants)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)])
    model.ir_version = 8
    properties = {} if card is None else {CARD_METADATA_KEY: json.dumps(card)}
    if int8_of is not None:
        properties[SOURCE_METADATA_KEY] = digest(int8_of)
    helper.set_model_props(model, properties)
    onnx.save(model, str(path))
    return path


def hinted_card(**changes: Any) -> dict[str, Any]:
    """Card of `write_hinted_network`."""
    return card_values(**{"card_version": 2, "hints": ["ground", "points"], "uncertainty": True, **changes})


def write_hinted_network(
    path: Path, card: dict[str, Any] | None = None, *, unhinted: float = 1e-3, sigma: float = -2.0
) -> Path:
    """A network that believes its hints: a pixel's inverse depth is the larger one of ground and point.

    Args:
        path: the file to write.
        card: the card to put into the metadata; None: `hinted_card()`.
        unhinted: inverse depth where there is neither.
        sigma: log of relative sigma everywhere.
    """
    shape = [1, 1, HEIGHT, WIDTH]
    inputs = [
        helper.make_tensor_value_info(name, TensorProto.FLOAT, [1, channels, HEIGHT, WIDTH])
        for name, channels in (("image", 3), ("ground", 1), ("points", 2))
    ]
    outputs = [
        helper.make_tensor_value_info(name, TensorProto.FLOAT, shape)
        for name in ("log_inverse_depth", "log_sigma")
    ]
    constants = [
        numpy_helper.from_array(np.array([0], dtype=np.int64), "first"),
        numpy_helper.from_array(np.array([0.0], dtype=np.float32), "zero"),
        numpy_helper.from_array(np.array([unhinted], dtype=np.float32), "unhinted"),
        numpy_helper.from_array(np.array([sigma], dtype=np.float32), "sigma"),
    ]
    nodes = [
        helper.make_node("Gather", ["image", "first"], ["red"], axis=1),
        helper.make_node("Mul", ["red", "zero"], ["nothing"]),
        helper.make_node("Gather", ["points", "first"], ["known"], axis=1),
        helper.make_node("Max", ["ground", "known", "unhinted"], ["inverse"]),
        helper.make_node("Log", ["inverse"], ["log"]),
        helper.make_node("Add", ["log", "nothing"], ["log_inverse_depth"]),
        helper.make_node("Add", ["nothing", "sigma"], ["log_sigma"]),
    ]
    model = helper.make_model(
        helper.make_graph(nodes, "hinted", inputs, outputs, constants),
        opset_imports=[helper.make_opsetid("", 17)],
    )
    model.ir_version = 8
    helper.set_model_props(model, {CARD_METADATA_KEY: json.dumps(hinted_card() if card is None else card)})
    onnx.save(model, str(path))
    return path


def write_formatted_network(
    path: Path,
    *,
    layout: str = "nchw",
    output_shape: tuple[int, ...] = (1, 1, HEIGHT, WIDTH),
    element: int = TensorProto.FLOAT,
) -> Path:
    """A network without a card whose output is its first channel, in the shape and number format asked for.

    Args:
        path: the file to write.
        layout: "nchw" or "nhwc", of the input.
        output_shape: of the output.
        element: number format of input and output.
    """
    size = [1, 3, HEIGHT, WIDTH] if layout == "nchw" else [1, HEIGHT, WIDTH, 3]
    constants = [
        numpy_helper.from_array(np.array(0, dtype=np.int64), "first"),
        numpy_helper.from_array(np.array(output_shape, dtype=np.int64), "shape"),
    ]
    axis = 1 if layout == "nchw" else 3
    nodes = [
        helper.make_node("Gather", ["x", "first"], ["channel"], axis=axis),
        helper.make_node("Reshape", ["channel", "shape"], ["y"]),
    ]
    graph = helper.make_graph(
        nodes,
        "formatted",
        [helper.make_tensor_value_info("x", element, size)],
        [helper.make_tensor_value_info("y", element, list(output_shape))],
        constants,
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)])
    model.ir_version = 8
    onnx.save(model, str(path))
    return path
