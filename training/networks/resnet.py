"""ResNet-18 (He et al. 2016), the paper's encoder: five feature maps at 1/2 to 1/32 of the picture.

Parameters carry torchvision's names, so that a downloaded ImageNet state dict fits.
"""

from __future__ import annotations

import pickle
from collections.abc import Mapping
from pathlib import Path
from typing import cast

import torch
from torch import Tensor, nn
from torch.nn import functional

from training.errors import PretrainedWeightsError
from training.networks.image_normalization import ImageNormalization

RESNET18_CHANNELS = (64, 64, 128, 256, 512)

_CLASSIFIER = "fc."
_COUNTER = "num_batches_tracked"

_READ_ERRORS = (RuntimeError, EOFError, ValueError, KeyError, AttributeError, TypeError)
"""Whatever else PyTorch raises for a file that is something else."""


class BasicBlock(nn.Module):
    """Two 3x3 convolutions around a shortcut, which is a 1x1 convolution where size or width change."""

    def __init__(self, inputs: int, outputs: int, stride: int) -> None:
        super().__init__()
        self.conv1 = nn.Conv2d(inputs, outputs, 3, stride, 1, bias=False)
        self.bn1 = nn.BatchNorm2d(outputs)
        self.conv2 = nn.Conv2d(outputs, outputs, 3, 1, 1, bias=False)
        self.bn2 = nn.BatchNorm2d(outputs)
        self.downsample: nn.Sequential | None = None
        if stride != 1 or inputs != outputs:
            self.downsample = nn.Sequential(
                nn.Conv2d(inputs, outputs, 1, stride, bias=False), nn.BatchNorm2d(outputs)
            )

    def forward(self, features: Tensor) -> Tensor:
        shortcut = features if self.downsample is None else self.downsample(features)
        hidden = functional.relu(self.bn1(self.conv1(features)), inplace=True)
        return functional.relu(self.bn2(self.conv2(hidden)) + shortcut, inplace=True)


class ResNet18(nn.Module):
    """The encoder; random weights (He et al. 2015, fan-out) until `load_resnet18` brings better ones."""

    channels = RESNET18_CHANNELS

    def __init__(self) -> None:
        super().__init__()
        self.normalization = ImageNormalization()
        self.conv1 = nn.Conv2d(3, 64, 7, 2, 3, bias=False)
        self.bn1 = nn.BatchNorm2d(64)
        self.maxpool = nn.MaxPool2d(3, 2, 1)
        self.layer1 = _layer(64, 64, stride=1)
        self.layer2 = _layer(64, 128, stride=2)
        self.layer3 = _layer(128, 256, stride=2)
        self.layer4 = _layer(256, 512, stride=2)
        for module in self.modules():
            if isinstance(module, nn.Conv2d):
                nn.init.kaiming_normal_(module.weight, mode="fan_out", nonlinearity="relu")

    def forward(self, image: Tensor) -> list[Tensor]:
        """Feature maps of a (N, 3, H, W) picture, RGB in 0..1, finest first."""
        stem = functional.relu(self.bn1(self.conv1(self.normalization(image))))
        maps = [stem, self.layer1(self.maxpool(stem))]
        for layer in (self.layer2, self.layer3, self.layer4):
            maps.append(layer(maps[-1]))
        return maps


def load_resnet18(network: nn.Module, path: Path) -> None:
    """Give a network's ResNet-18 encoder the weights of a torchvision file.

    The classifier (`fc.`) is ignored. Nothing is changed if anything does not fit.

    Args:
        network: a `ResNet18`, or a network whose `encoder` is one.
        path: a state dict with torchvision's names, as its `resnet18` weights are published.

    Raises:
        PretrainedWeightsError: no such encoder, no such file, a file that is not a state dict, or an entry
            that is missing, unknown, of another shape or not finite.
    """
    encoder = network if isinstance(network, ResNet18) else getattr(network, "encoder", None)
    if not isinstance(encoder, ResNet18):
        raise PretrainedWeightsError(
            f"{path}: weights of ResNet-18 for {type(network).__name__}, whose encoder is "
            f"{type(encoder).__name__}"
        )
    encoder.load_state_dict(_fitting(_read_state(path), encoder.state_dict(), path))


def _layer(inputs: int, outputs: int, stride: int) -> nn.Sequential:
    return nn.Sequential(BasicBlock(inputs, outputs, stride), BasicBlock(outputs, outputs, 1))


def _read_state(path: Path) -> Mapping[str, Tensor]:
    try:
        state = torch.load(path, map_location="cpu", weights_only=True)
    except OSError as error:
        raise PretrainedWeightsError(f"cannot read the encoder weights {path}: {error.strerror}") from error
    except pickle.UnpicklingError as error:
        # PyTorch's own text advises to load the file without its protection.
        raise PretrainedWeightsError(f"{path} is not a file of weights") from error
    except _READ_ERRORS as error:
        raise PretrainedWeightsError(f"{path} is not a file of weights: {error}") from error
    if not isinstance(state, Mapping) or not all(isinstance(value, Tensor) for value in state.values()):
        raise PretrainedWeightsError(f"{path} is not a state dict: names with tensors are needed")
    return cast(Mapping[str, Tensor], state)


def _fitting(given: Mapping[str, Tensor], own: Mapping[str, Tensor], path: Path) -> dict[str, Tensor]:
    """The entries for the encoder, each checked against the encoder's own."""
    fitting = {key: value for key, value in given.items() if not key.startswith(_CLASSIFIER)}
    for key, value in own.items():
        if key not in fitting:
            if key.endswith(_COUNTER):
                # Files written before PyTorch 0.4.1 lack it, and only averaging without momentum reads it.
                fitting[key] = value
                continue
            raise PretrainedWeightsError(f"{path} has no entry {key!r}: ResNet-18 needs it")
        entry = fitting[key]
        if entry.shape != value.shape:
            raise PretrainedWeightsError(
                f"{path}: {key} has shape {tuple(entry.shape)}, ResNet-18 needs {tuple(value.shape)}"
            )
        if not bool(torch.isfinite(entry).all()):
            raise PretrainedWeightsError(f"{path}: {key} holds numbers that are not finite")
    unknown = next((key for key in fitting if key not in own), None)
    if unknown is not None:
        raise PretrainedWeightsError(f"{path}: {unknown!r} is no entry of ResNet-18")
    return fitting
