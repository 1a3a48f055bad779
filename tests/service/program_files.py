"""Configuration, pictures and network of a service that is started from the command line."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import onnx
from onnx import TensorProto, helper

from uavdepth.model.card import CARD_METADATA_KEY

SIZE = "width = 160\nheight = 96\nhorizontal_fov_deg = 80\n"


def write_network(path: Path, card: dict[str, object] | None) -> Path:
    """A network whose depth is the picture's red channel."""
    picture = helper.make_tensor_value_info("image", TensorProto.FLOAT, [1, 3, 32, 48])
    depth = helper.make_tensor_value_info("log_inverse_depth", TensorProto.FLOAT, [1, 1, 32, 48])
    channels = helper.make_tensor("red", TensorProto.INT64, [1], [0])
    gather = helper.make_node("Gather", ["image", "red"], ["log_inverse_depth"], axis=1)
    graph = helper.make_graph([gather], "red", [picture], [depth], [channels])
    network = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)])
    network.ir_version = 9
    if card is not None:
        helper.set_model_props(network, {CARD_METADATA_KEY: json.dumps(card)})
    onnx.save(network, str(path))
    return path


CARD: dict[str, object] = {
    "card_version": 1,
    "name": "red",
    "input_width": 48,
    "input_height": 32,
    "mean": [0.0, 0.0, 0.0],
    "std": [1.0, 1.0, 1.0],
    "output": "log_inverse_depth",
    "metric": False,
    "uncertainty": False,
    "focal_px": 40.0,
    "max_depth_m": 100.0,
    "training_data": "none",
    "licence": "Apache-2.0",
    "measured": {},
    "created": "2026-01-01T00:00:00Z",
}


def write_pictures(folder: Path, count: int = 2, size: tuple[int, int] = (96, 160)) -> Path:
    folder.mkdir()
    for number in range(count):
        assert cv2.imwrite(str(folder / f"{number}.png"), np.full((*size, 3), 90, np.uint8))
    return folder


def write_config(folder: Path, source: Path | str, model: Path | str | None = None, more: str = "") -> Path:
    if model is None:
        model = write_network(folder / "red.onnx", CARD)
    path = folder / "drone.toml"
    path.write_text(
        f"[camera]\nsource = '{source}'\n{SIZE}[model]\npath = '{model}'\n"
        f"[zenoh]\nenabled = false\n[autopilot]\nendpoint = 'udp:127.0.0.1:0'\n{more}"
    )
    return path
