"""Writes depth_anything_tiny.onnx: Depth Anything's graph from transformers, tiny, with random weights.

The tests read the file; this script says how it came about, and needs packages that the project does not:

    python -m venv venv && venv/bin/pip install torch==2.13.0 onnx onnxscript transformers==5.23.0
    venv/bin/python tests/data/make_depth_anything_tiny.py tests/data/depth_anything_tiny.onnx

What is foreign in it: any picture size of whole patches of 14 pixels, an output without a channel axis
(1, height, width), names of its own, inverse depth up to scale and shift.
"""

from __future__ import annotations

import sys
from typing import Any

import onnx
import torch
from torch.export import Dim
from transformers import DepthAnythingConfig, DepthAnythingForDepthEstimation, Dinov2Config
from transformers.models.depth_anything import modeling_depth_anything


class DepthOnly(torch.nn.Module):
    """The network with its depth as the only output."""

    def __init__(self, network: torch.nn.Module) -> None:
        super().__init__()
        self.network = network

    def forward(self, pixel_values: torch.Tensor) -> torch.Tensor:
        """(1, H, W) inverse depth up to scale and shift of a (1, 3, H, W) normalised picture."""
        depth: torch.Tensor = self.network(pixel_values=pixel_values).predicted_depth
        return depth


def tiny_network() -> torch.nn.Module:
    """Four layers of width 16 instead of twelve of 384; weights large enough that depth varies."""
    torch.manual_seed(0)
    backbone = Dinov2Config(
        hidden_size=16,
        num_hidden_layers=4,
        num_attention_heads=2,
        mlp_ratio=2,
        image_size=70,
        patch_size=14,
        out_indices=[1, 2, 3, 4],
        reshape_hidden_states=False,
        apply_layernorm=True,
        initializer_range=0.2,
    )
    config = DepthAnythingConfig(
        backbone_config=backbone,
        patch_size=14,
        reassemble_hidden_size=16,
        reassemble_factors=[4, 2, 1, 0.5],
        neck_hidden_sizes=[8, 8, 8, 8],
        fusion_hidden_size=8,
        head_hidden_size=8,
        initializer_range=0.2,
    )
    return DepthAnythingForDepthEstimation(config).eval()


def export(network: torch.nn.Module) -> onnx.ModelProto:
    """The graph with free height and width, without notes of the machine that made it."""
    # The head says int(height), which would freeze the size at export.
    modeling_depth_anything.int = lambda value: value if isinstance(value, torch.SymInt) else int(value)
    sizes = {2: 14 * Dim("rows", min=2, max=80), 3: 14 * Dim("columns", min=2, max=80)}
    program: Any = torch.onnx.export(
        DepthOnly(network),
        (torch.rand(1, 3, 70, 98),),
        input_names=["pixel_values"],
        output_names=["predicted_depth"],
        opset_version=18,
        dynamo=True,
        verbose=False,
        dynamic_shapes={"pixel_values": sizes},
    )
    model: onnx.ModelProto = program.model_proto
    del model.metadata_props[:]
    graph = model.graph
    for item in (graph, *graph.node, *graph.initializer, *graph.value_info, *graph.input, *graph.output):
        del item.metadata_props[:]
        item.doc_string = ""
    del graph.value_info[:]
    for value in (graph.input[0], graph.output[0]):
        rows, columns = value.type.tensor_type.shape.dim[-2:]
        rows.dim_param, columns.dim_param = "height", "width"
    onnx.checker.check_model(model)
    return model


if __name__ == "__main__":
    onnx.save(export(tiny_network()), sys.argv[1])
