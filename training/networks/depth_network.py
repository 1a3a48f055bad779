"""The depth network that ships: EfficientNet-Lite0, feature aggregation nodes, attention decoder, hints.

The picture gives shape, hints give metres: the ground's plane and measured points come in as pictures of
inverse depth, are added to the encoder's maps, and at the end the points correct the prediction.

Full-width nodes at half resolution would cost more than all the rest, so that level has one depthwise node,
and both outputs are made there and up-sampled once.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import torch
from torch import Tensor, nn

from training.networks.aggregation import AggregationGrid
from training.networks.blocks import ConvNormRelu, upsample
from training.networks.decoder import Decoder, Head
from training.networks.encoder import ENCODER_CHANNELS, EfficientNetLite0
from training.networks.hint_correction import HintCorrection
from training.networks.hint_encoder import HintEncoder
from training.networks.hint_levels import HintLevels, hint_levels

INITIAL_DEPTH_M = 8.0
"""Depth that an untrained head gives: about the median of the training frames."""

INITIAL_RELATIVE_SIGMA = 0.3


@dataclass(frozen=True)
class NetworkShape:
    """Widths of the network, written into every checkpoint.

    Args:
        channels: width of the levels 1/2, 1/4, 1/8, 1/16 and 1/32 in grid and decoder.
        columns: aggregation nodes of each level.
        head_channels: width of the layer before the first prediction.
        frozen_stages: encoder stages that keep their ImageNet weights.
        hint_channels: width between the two convolutions of the hints at each level.
        correction_channels: width of the last stage.
    """

    channels: tuple[int, int, int, int, int] = (16, 32, 48, 64, 96)
    columns: tuple[int, int, int, int, int] = (1, 2, 2, 1, 0)
    head_channels: int = 16
    frozen_stages: int = 3
    hint_channels: tuple[int, int, int, int, int] = (8, 16, 16, 24, 24)
    correction_channels: int = 16


@dataclass(frozen=True)
class DepthOutput:
    """What the network says about a batch of pictures.

    Args:
        log_inverse_depth: (N, 1, H, W), log of focal_x / (focal_reference * depth), both focal lengths in
            pixels of the network's picture width.
        log_sigma: (N, 1, H, W), log of the standard deviation of that depth over depth, as given.
        uncorrected: (N, 1, H, W), log inverse depth before the points corrected it, for the loss.
    """

    log_inverse_depth: Tensor
    log_sigma: Tensor
    uncorrected: Tensor


class DepthNetwork(nn.Module):
    """Log inverse depth and its uncertainty from one picture and whatever hints there are."""

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
        self.hints = HintEncoder(widths, self.shape.hint_channels)
        self.aggregation = AggregationGrid(widths, self.shape.columns)
        self.decoder = Decoder(widths)
        self.depth_head = Head(widths[0], self.shape.head_channels, -math.log(INITIAL_DEPTH_M))
        self.correction = HintCorrection(widths[0], self.shape.correction_channels, INITIAL_RELATIVE_SIGMA)

    def forward(
        self, image: Tensor, ground: Tensor | None = None, points: Tensor | None = None
    ) -> DepthOutput:
        """Depth of a picture.

        Args:
            image: (N, 3, H, W) normalised RGB; H and W divisible by 32.
            ground: (N, 1, H, W) q of the flat ground (`uavdepth.model.hint_planes`), 0 where there is none.
            points: (N, 2, H, W) q of measured points and the confidence in them, 0 where there is none.
        """
        size = (image.shape[0], 1, *image.shape[2:])
        ground = image.new_zeros(size) if ground is None else ground
        points = image.new_zeros((size[0], 2, *size[2:])) if points is None else points
        half = self.at_half_size(image, hint_levels(ground, points))
        return DepthOutput(
            upsample(half.log_inverse_depth), upsample(half.log_sigma), upsample(half.uncorrected)
        )

    def at_half_size(self, image: Tensor, hints: HintLevels) -> DepthOutput:
        """The same before it is brought to the picture's size, (N, 1, H/2, W/2) each: what is exported."""
        additions, hinted_context = self.hints(hints)
        pyramid = [
            lateral(level) + addition
            for lateral, level, addition in zip(self.laterals, self.encoder(image), additions, strict=True)
        ]
        # The mean over the picture tells every pixel what the whole shows: street or forest, high or low.
        whole = self.context(pyramid[-1].mean(dim=(2, 3), keepdim=True)) + hinted_context
        pyramid[-1] = pyramid[-1] + torch.relu(whole)
        features = self.decoder(pyramid, self.aggregation(pyramid))
        predicted = self.depth_head(features).float()
        corrected, log_sigma = self.correction(features, predicted, hints)
        return DepthOutput(corrected, log_sigma, predicted)
