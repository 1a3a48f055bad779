"""What every self-supervised depth network has in common: four disparities from one picture."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from typing import Protocol

import torch
from torch import Tensor, nn
from torch.nn import functional

from uavdepth.errors import ImageSizeError

SIZE_STEP = 32
SMALLEST_SIDE = 64
"""Below two pixels at 1/32 there is nothing that reflection padding could reflect."""

SCALES = 4


class PyramidEncoder(Protocol):
    """Five feature maps, 1/2 to 1/32 of the picture, finest first; `channels` are their widths."""

    channels: tuple[int, ...]

    def __call__(self, image: Tensor) -> list[Tensor]: ...


class ReflectConv(nn.Conv2d):
    """3x3 convolution that reflects the map at its border."""

    def __init__(self, inputs: int, outputs: int) -> None:
        super().__init__(inputs, outputs, 3)

    def forward(self, input: Tensor) -> Tensor:
        return super().forward(functional.pad(input, (1, 1, 1, 1), mode="reflect"))


class DisparityNetwork(nn.Module, ABC):
    """An encoder, a decoder and a disparity head on each of the decoder's four finest maps.

    Args:
        encoder: made before anything else, so that networks built after the same seed begin with the same
            encoder.
        head_channels: widths of the decoder's maps at 1, 1/2, 1/4 and 1/8 of the picture.
    """

    def __init__(self, encoder: nn.Module, head_channels: Sequence[int]) -> None:
        super().__init__()
        self.encoder = encoder
        self.heads = nn.ModuleList(ReflectConv(channels, 1) for channels in head_channels)

    def forward(self, image: Tensor) -> tuple[Tensor, ...]:
        """Sigmoid disparities, finest first: (N, 1, H / 2^s, W / 2^s) for s = 0..3.

        Args:
            image: (N, 3, H, W), RGB in 0..1; H and W divisible by 32 and at least 64.

        Raises:
            ImageSizeError: H or W is not.
        """
        _check_size(image)
        return self._disparities(self.decode(self.encoder(image)))

    @abstractmethod
    def decode(self, pyramid: Sequence[Tensor]) -> Sequence[Tensor]:
        """The decoder's maps at 1, 1/2, 1/4 and 1/8 of the picture from the encoder's five."""

    def _disparities(self, features: Iterable[Tensor]) -> tuple[Tensor, ...]:
        return tuple(torch.sigmoid(head(item)) for head, item in zip(self.heads, features, strict=True))


def double_nearest(features: Tensor) -> Tensor:
    """The map at twice its size, every pixel repeated."""
    return functional.interpolate(features, scale_factor=2.0, mode="nearest")


def disparity_to_depth(disparity: Tensor, min_depth_m: float = 0.1, max_depth_m: float = 100.0) -> Tensor:
    """Depth in metres of a sigmoid disparity: its inverse runs linearly from 1/max to 1/min.

    Without a known motion the metres are only as good as the pose network's unit (Godard et al. 2019).

    Args:
        disparity: any shape, 0..1.
        min_depth_m: depth at disparity 1.
        max_depth_m: depth at disparity 0.

    Raises:
        ValueError: the two depths are not positive and rising.
    """
    if not 0.0 < min_depth_m < max_depth_m:
        raise ValueError(f"depths run from {min_depth_m} to {max_depth_m} m: 0 < min < max is needed")
    lowest, highest = 1.0 / max_depth_m, 1.0 / min_depth_m
    return 1.0 / (lowest + (highest - lowest) * disparity)


def _check_size(image: Tensor) -> None:
    height, width = image.shape[-2:]
    for name, size in (("width", width), ("height", height)):
        if size % SIZE_STEP or size < SMALLEST_SIDE:
            raise ImageSizeError(
                f"the picture's {name} is {size}: a multiple of {SIZE_STEP} from {SMALLEST_SIDE} on is needed"
            )
