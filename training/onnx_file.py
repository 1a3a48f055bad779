"""ONNX files from PyTorch modules: traced, cleaned of traces, in place only when they compute the same."""

from __future__ import annotations

import logging
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, cast

import onnx
import torch
from onnx_ir.passes.common import DeduplicateInitializersPass
from torch import Tensor, nn

from uavdepth.model.card import CARD_METADATA_KEY, ModelCard

OPSET = 18
"""The first with the Pad and ReduceMean that PyTorch writes; ONNX Runtime knows it since 1.14 (2023)."""


def trace(
    module: nn.Module, inputs: Sequence[Tensor], input_names: Sequence[str], output_names: Sequence[str]
) -> onnx.ModelProto:
    """The graph of a module in evaluation mode, without the paths and source lines that PyTorch notes."""
    with torch.no_grad(), _quiet_exporter():
        program = torch.onnx.export(
            module,
            tuple(inputs),
            input_names=list(input_names),
            output_names=list(output_names),
            opset_version=OPSET,
            dynamo=True,
            verbose=False,
        )
    DeduplicateInitializersPass()(cast(Any, program).model)
    model = cast(onnx.ModelProto, cast(Any, program).model_proto)
    strip_traces(model)
    return model


def write_checked(
    model: onnx.ModelProto,
    card: ModelCard,
    path: Path,
    check: Callable[[Path], None],
    properties: Mapping[str, str] | None = None,
) -> None:
    """Write a graph with its card; the file takes its place when the check has passed.

    Args:
        model: the graph.
        card: what the file says about itself.
        path: where to; a failure leaves an old file whole.
        check: gets a file beside `path` and raises what is wrong with it.
        properties: further entries of the file's metadata.
    """
    onnx.checker.check_model(model)
    onnx.helper.set_model_props(model, {CARD_METADATA_KEY: card.to_json(), **(properties or {})})
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_name(f".{path.name}.part.onnx")
    try:
        partial.write_bytes(model.SerializeToString())
        check(partial)
        partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)


@contextmanager
def _quiet_exporter() -> Iterator[None]:
    """The exporter warns about packages that are not needed and about its own deprecations."""
    logger = logging.getLogger("torch.onnx")
    level = logger.level
    logger.setLevel(logging.ERROR)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        logger.setLevel(level)


def strip_traces(model: onnx.ModelProto) -> None:
    """Take out the source lines, with this machine's paths, and the notes that tools leave at every node."""
    del model.metadata_props[:]
    del model.graph.metadata_props[:]
    model.doc_string = model.graph.doc_string = ""
    graph = model.graph
    for item in (*graph.node, *graph.initializer, *graph.value_info, *graph.input, *graph.output):
        del item.metadata_props[:]
        item.doc_string = ""
