"""ONNX files of self-supervised networks with fresh weights: speed does not depend on them."""

from __future__ import annotations

import warnings
from pathlib import Path

import torch
from torch import Tensor, nn

from training.networks.catalogue import build_network

OUTPUT_NAME = "disparity"
OPSET = 18


class _FinestScale(nn.Module):
    """The one disparity that flies; the coarser three serve the loss."""

    def __init__(self, network: nn.Module) -> None:
        super().__init__()
        self.network = network

    def forward(self, image: Tensor) -> Tensor:
        finest: Tensor = self.network(image)[0]
        return finest


def export_fresh_network(name: str, width: int, height: int, path: Path) -> None:
    """Write a network of the catalogue as float32 ONNX without a card.

    Args:
        name: one of `training.networks.catalogue.NETWORK_NAMES`.
        width, height: of its input "image" (1, 3, height, width) and of its output "disparity".
        path: the file to write.

    Raises:
        TrainingSettingsError: no such network.
    """
    torch.manual_seed(0)
    network = _FinestScale(build_network(name)).eval()
    with torch.no_grad(), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        # The older exporter: it takes seconds where the newer one takes a minute, for the same graph.
        torch.onnx.export(
            network,
            (torch.zeros(1, 3, height, width),),
            str(path),
            input_names=["image"],
            output_names=[OUTPUT_NAME],
            opset_version=OPSET,
            dynamo=False,
        )
