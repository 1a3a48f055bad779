"""The depth network that ships: EfficientNet-Lite0, feature aggregation nodes, attention decoder.

3.33 M parameters; at 384x192 2.28 GFLOP (multiplications and additions): encoder 1.07, aggregation 0.32,
decoder 0.73, heads 0.14. Full-width nodes at half resolution would cost more than all the rest, so that
level has one depthwise node, and both heads answer there and are up-sampled once.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import torch
from torch import Tensor, nn

from training.networks.aggregation import AggregationGrid
from training.networks.blocks import ConvNormRelu
from training.networks.decoder import Decoder, Head
from training.networks.encoder import ENCODER_CHANNELS, EfficientNetLite0

INITIAL_DEPTH_M = 8.0
"""Depth that an untrained head gives: about the median of the training frames."""

INITIAL_RELATIVE_SIGMA = 0.3


@dataclass(frozen=True)
class NetworkShape:
    """Widths of the network, written into every checkpoint.

    Args:
        channels: width of the levels 1/2, 1/4, 1/8, 1/16 and 1/32 in grid and decoder.
        columns: aggregation nodes of each level.
        head_channels: width of the layer before each output.
        frozen_stages: encoder stages that keep their ImageNet weights.
    """

    channels: tuple[int, int, int, int, int] = (16, 32, 48, 64, 96)
    columns: tuple[int, int, int, int, int] = (1, 2, 2, 1, 0)
    head_channels: int = 16
    frozen_stages: int = 3


@dataclass(frozen=True)
class DepthOutput:
    """What the network says about a batch of pictures.

    Args:
        log_inverse_depth: (N, 1, H, W), log of focal_x / (focal_reference * depth), both focal lengths in
            pixels of the network's picture width.
        log_sigma: (N, 1, H, W), log of the standard deviation of depth over depth, once the picture's
            overall scale is known.
    """

    log_inverse_depth: Tensor
    log_sigma: Tensor


class DepthNetwork(nn.Module):
    """Log inverse depth and its uncertainty from one picture."""

    def __init__(self, shape: NetworkShape | None = None) -> None:
        super().__init__()
        self.shape = shape or NetworkShape()
        widths = self.shape.channels
        self.encoder = EfficientNetLite0(self.shape.frozen_stages)
        self.laterals = nn.ModuleList(
            ConvNormRelu(inputs, width, kernel=1)
            for inputs, width in zip(ENCODER_CHANNELS, widths, strict=True)
        )
        self.context = nn.Conv2d(widths[-1], widths[-1], 1)
        self.aggregation = AggregationGrid(widths, self.shape.columns)
        self.decoder = Decoder(widths)
        self.depth_head = Head(widths[0], self.shape.head_channels, -math.log(INITIAL_DEPTH_M))
        self.sigma_head = Head(widths[0], self.shape.head_channels // 2, math.log(INITIAL_RELATIVE_SIGMA))

    def forward(self, image: Tensor) -> DepthOutput:
        """Depth of a normalised (N, 3, H, W) picture; H and W divisible by 32."""
        pyramid = [lateral(level) for lateral, level in zip(self.laterals, self.encoder(image), strict=True)]
        # The mean over the picture tells every pixel what the whole shows: street or forest, high or low.
        pyramid[-1] = pyramid[-1] + torch.relu(self.context(pyramid[-1].mean(dim=(2, 3), keepdim=True)))
        features = self.decoder(pyramid, self.aggregation(pyramid))
        return DepthOutput(self.depth_head(features), self.sigma_head(features))
