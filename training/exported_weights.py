"""The weights of an exported file as a network to train on: the inverse of `training.half_weights`.

An exported file has its normalisations folded into the convolutions. To train on they are needed again, and
they need statistics: those of pictures. The network computes the same before and after, in evaluation mode;
what half precision has rounded stays rounded.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import cast

import onnx
import torch
from onnx import numpy_helper
from torch import Tensor, nn

from training.data.batches import Batch
from training.errors import CheckpointError
from training.half_weights import restore_single
from training.networks.blocks import ConvNormRelu
from training.networks.depth_network import DepthNetwork
from uavdepth.model.int8_file import SOURCE_METADATA_KEY

_PREFIX = "network."
"""Of the weights' names in an exported file."""


def take_exported(path: Path, network: DepthNetwork, batches: Iterable[Batch]) -> int:
    """Give a network the weights of an exported file, with normalisations that can be trained on.

    Args:
        path: the file, in single or half precision (`uavdepth export`), not in 8 bits.
        network: of the shape that was exported; is changed in place.
        batches: whose statistics the normalisations are given; some dozens of pictures are enough.

    Returns:
        How many numbers were taken over.

    Raises:
        CheckpointError: no such file, one in 8 bits, none of this program, or one of another network.
    """
    folded = _read(path)
    numbers = sum(value.numel() for value in folded.values())
    state, blocks = network.state_dict(), _normalised_blocks(network)
    for name in blocks:
        bias = folded.pop(f"{name}.convolution.bias", None)
        if bias is None:
            raise CheckpointError(f"{path} is not an export of this network: it lacks {name}")
        _set_identity(state, f"{name}.norm", bias, blocks[name].norm.eps)
    unknown = sorted(name for name, value in folded.items() if _shape(state, name) != value.shape)
    missing = sorted(
        name for name, _ in network.named_parameters() if name not in folded and ".norm." not in name
    )
    if unknown or missing:
        raise CheckpointError(
            f"{path} is not an export of this network: {(unknown or missing)[0]} does not fit"
        )
    network.load_state_dict({**state, **folded})
    _give_statistics(network, (block.norm for block in blocks.values()), batches)
    return numbers


def _read(path: Path) -> dict[str, Tensor]:
    if not path.is_file():
        raise CheckpointError(f"no network at {path}")
    try:
        model = onnx.load(str(path))
    except Exception as error:  # protobuf's own errors have no common class that is public
        raise CheckpointError(f"{path} is no ONNX file: {error}") from error
    if any(entry.key == SOURCE_METADATA_KEY for entry in model.metadata_props):
        raise CheckpointError(f"{path} is an 8-bit file: name the network that it was made from")
    restore_single(model)
    return {
        constant.name.removeprefix(_PREFIX): torch.from_numpy(numpy_helper.to_array(constant).copy())
        for constant in model.graph.initializer
        if constant.name.startswith(_PREFIX)
    }


def _normalised_blocks(network: nn.Module) -> dict[str, ConvNormRelu]:
    return {name: module for name, module in network.named_modules() if isinstance(module, ConvNormRelu)}


def _shape(state: dict[str, Tensor], name: str) -> torch.Size | None:
    return state[name].shape if name in state else None


def _set_identity(state: dict[str, Tensor], norm: str, bias: Tensor, epsilon: float) -> None:
    """A normalisation that adds the bias and does nothing else."""
    state[f"{norm}.weight"] = torch.ones_like(bias)
    state[f"{norm}.bias"] = bias
    state[f"{norm}.running_mean"] = torch.zeros_like(bias)
    state[f"{norm}.running_var"] = torch.full_like(bias, 1.0 - epsilon)


class _Moments:
    """Mean and variance of each channel of what a normalisation gets."""

    def __init__(self, norm: nn.BatchNorm2d) -> None:
        self._norm = norm
        self._sum = torch.zeros(norm.num_features, dtype=torch.float64)
        self._squares = torch.zeros_like(self._sum)
        self._pixels = 0
        self.hook = norm.register_forward_pre_hook(self._count)

    def _count(self, _: nn.Module, inputs: tuple[Tensor, ...]) -> None:
        values = inputs[0].double()
        self._sum += values.sum(dim=(0, 2, 3))
        self._squares += values.square().sum(dim=(0, 2, 3))
        self._pixels += values.numel() // len(self._sum)

    def set(self) -> None:
        """Give them to the normalisation, with the gain and the offset that undo them."""
        norm = self._norm
        mean = self._sum / self._pixels
        variance = (self._squares / self._pixels - mean.square()).clamp(min=0.0)
        norm.weight.copy_(torch.sqrt(variance + norm.eps))
        norm.bias.add_(mean)
        cast(Tensor, norm.running_mean).copy_(mean)
        cast(Tensor, norm.running_var).copy_(variance)


def _give_statistics(
    network: DepthNetwork, norms: Iterable[nn.BatchNorm2d], batches: Iterable[Batch]
) -> None:
    moments = [_Moments(norm) for norm in norms]
    was_training = network.training
    try:
        network.eval()
        with torch.no_grad():
            for batch in batches:
                network(batch.image, batch.ground, batch.points)
            for each in moments:
                each.set()
    finally:
        for each in moments:
            each.hook.remove()
        network.train(was_training)
