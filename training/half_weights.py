"""Weights in half precision: what an exported file stores, while the arithmetic stays in single precision."""

from __future__ import annotations

import copy

import numpy as np
import onnx
import torch
from onnx import TensorProto, helper, numpy_helper
from torch import nn
from torch.nn.utils.fusion import fuse_conv_bn_eval

from training.errors import ExportError
from training.networks.blocks import ConvNormRelu
from training.networks.depth_network import DepthNetwork

SMALLEST_HALVED = 10_000
"""Numbers in a weight from which on it is halved: the large 1x1 and 3x3 convolutions, 94 % of the network.

The many small ones, depthwise convolutions above all, have errors that nothing averages out: halved as well
they would make depth differ by 0.45 % on average, against 0.03 % without.
"""

_HALF = "_half"


def rounded_network(network: DepthNetwork) -> DepthNetwork:
    """A copy whose normalisations are folded into the convolutions, large weights rounded to half precision.

    Args:
        network: in evaluation mode; stays as it is.

    Raises:
        ExportError: a weight beyond half precision's 65504, or one that is not finite.
    """
    rounded = copy.deepcopy(network).eval()
    for block in [module for module in rounded.modules() if isinstance(module, ConvNormRelu)]:
        block.convolution = fuse_conv_bn_eval(block.convolution, block.norm)
        block.register_module("norm", nn.Identity())
    with torch.no_grad():
        for name, parameter in rounded.named_parameters():
            if parameter.numel() < SMALLEST_HALVED:
                continue
            half = parameter.half()
            if not torch.isfinite(half).all():
                largest = float(parameter.abs().max())
                raise ExportError(f"the weight {name} reaches {largest:g}: half precision ends at 65504")
            parameter.copy_(half.float())
    return rounded


def store_in_half(model: onnx.ModelProto) -> None:
    """Store the graph's constants as float16, each with a cast that gives single precision back.

    Only constants that half precision holds exactly are changed, so the network computes the same as before.
    ONNX Runtime and OpenVINO do the casts once, when they load the file.
    """
    graph = model.graph
    casts = []
    for constant in graph.initializer:
        if constant.data_type != TensorProto.FLOAT:
            continue
        values = numpy_helper.to_array(constant)
        half = values.astype(np.float16)
        if values.size < SMALLEST_HALVED or not np.array_equal(half.astype(np.float32), values):
            continue
        name = constant.name
        constant.CopyFrom(numpy_helper.from_array(half, name + _HALF))
        casts.append(helper.make_node("Cast", [name + _HALF], [name], name + "_cast", to=TensorProto.FLOAT))
    nodes = list(graph.node)
    del graph.node[:]
    graph.node.extend([*casts, *nodes])


def restore_single(model: onnx.ModelProto) -> None:
    """The inverse of `store_in_half`: constants in single precision, without the casts."""
    graph = model.graph
    constants = {constant.name: constant for constant in graph.initializer}
    kept = []
    for node in graph.node:
        half = constants.get(node.input[0]) if node.op_type == "Cast" else None
        if half is None or half.data_type != TensorProto.FLOAT16:
            kept.append(node)
            continue
        values = numpy_helper.to_array(half).astype(np.float32)
        half.CopyFrom(numpy_helper.from_array(values, node.output[0]))
    del graph.node[:]
    graph.node.extend(kept)
