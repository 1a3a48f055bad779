"""EfficientNet-Lite0 as an encoder of the self-supervised networks."""

from __future__ import annotations

from torch import Tensor, nn

from training.networks.encoder import ENCODER_CHANNELS, EfficientNetLite0
from training.networks.image_normalization import ImageNormalization
from training.normalization import IMAGE_MEAN, IMAGE_STD


class LiteEncoder(nn.Module):
    """EfficientNet-Lite0 that takes RGB in 0..1.

    Its first three stages are frozen: they keep their ImageNet weights.

    Args:
        pretrained: with the packaged ImageNet weights. False only makes sense where a checkpoint is loaded.

    Raises:
        PretrainedWeightsError: the package with the weights is missing.
    """

    channels = ENCODER_CHANNELS

    def __init__(self, *, pretrained: bool = True) -> None:
        super().__init__()
        self.normalization = ImageNormalization(IMAGE_MEAN, IMAGE_STD)
        self.features = EfficientNetLite0()
        if pretrained:
            self.features.load_imagenet()

    def forward(self, image: Tensor) -> list[Tensor]:
        """Feature maps of a (N, 3, H, W) picture, RGB in 0..1, finest first."""
        maps: list[Tensor] = self.features(self.normalization(image))
        return maps
