"""How many parameters a network has, and how many operations one picture costs.

Counted by PyTorch while the network runs on tensors without memory: convolutions and dense layers, which
leaves out the few per cent of element-wise work, as published figures do.
"""

from __future__ import annotations

import copy
from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Tensor, nn
from torch.utils.flop_counter import FlopCounterMode

from training.networks.catalogue import EFFICIENTNET_LITE0, NETWORK_NAMES, RESNET18, build_network
from training.networks.depth_network import DepthNetwork
from training.networks.pose_network import PoseNetwork

COUNT_SIZES = ((384, 192), (640, 320))
"""Width and height of the pictures, as in the paper's table of speeds."""

FLIGHT = "flight"
POSE = "pose"

_OPERATIONS_PER_MULTIPLY_ADD = 2


@dataclass(frozen=True)
class PictureCost:
    """What one picture of a size costs.

    Args:
        width, height: of the picture.
        multiply_adds: a multiplication together with its addition counts once. Papers on networks often
            call this FLOPs.
    """

    width: int
    height: int
    multiply_adds: int

    @property
    def operations(self) -> int:
        """Multiplications and additions, each counted."""
        return _OPERATIONS_PER_MULTIPLY_ADD * self.multiply_adds


@dataclass(frozen=True)
class NetworkCost:
    """A network's size and cost.

    Args:
        name: of the catalogue, or "pose" (for two pictures) or "flight" (with all hints).
        encoder: name of its encoder; None where it has none of its own kind.
        parameters: learnable numbers, frozen ones included.
        pictures: cost at each size.
    """

    name: str
    encoder: str | None
    parameters: int
    pictures: tuple[PictureCost, ...]


def count_parameters(network: nn.Module) -> int:
    """Learnable numbers of a network, frozen ones included."""
    return sum(parameter.numel() for parameter in network.parameters())


def count_multiply_adds(network: nn.Module, *inputs: Tensor) -> int:
    """Multiply-adds of one forward pass; only the shapes of the inputs matter."""
    without_memory = copy.deepcopy(network).to("meta").eval()
    with torch.no_grad(), FlopCounterMode(display=False) as counter:
        without_memory(*(item.to("meta") for item in inputs))
    return int(counter.get_total_flops()) // _OPERATIONS_PER_MULTIPLY_ADD


def count_networks() -> list[NetworkCost]:
    """Every network of the catalogue, the pose network and the one that flies."""
    # Weights are neither needed nor made.
    with torch.device("meta"):
        catalogue = {name: build_network(name) for name in NETWORK_NAMES}
        pose, flight = PoseNetwork(), DepthNetwork()
    costs = [_cost(name, RESNET18, network, _picture) for name, network in catalogue.items()]
    costs.append(_cost(POSE, None, pose, lambda width, height: _picture(width, height) * 2))
    costs.append(_cost(FLIGHT, EFFICIENTNET_LITE0, flight, _picture_with_hints))
    return costs


Inputs = Callable[[int, int], tuple[Tensor, ...]]


def _cost(name: str, encoder: str | None, network: nn.Module, inputs: Inputs) -> NetworkCost:
    pictures = tuple(
        PictureCost(width, height, count_multiply_adds(network, *inputs(width, height)))
        for width, height in COUNT_SIZES
    )
    return NetworkCost(name, encoder, count_parameters(network), pictures)


def _picture(width: int, height: int) -> tuple[Tensor, ...]:
    return (torch.empty(1, 3, height, width, device="meta"),)


def _picture_with_hints(width: int, height: int) -> tuple[Tensor, ...]:
    return tuple(torch.empty(1, channels, height, width, device="meta") for channels in (3, 1, 2))
