"""The pose network (section 2.4): how the camera moved between two frames.

7.7 M parameters; 0.2 G multiply-adds for a pair at 128x96.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

from training.networks.image_normalization import ImageNormalization

POSE_CHANNELS = (128, 256, 512, 1024)
REDUCED_CHANNELS = 256
POSE_SCALE = 0.01
"""Training starts near no motion, whatever the random weights say (Godard et al. 2019)."""


class PoseNetwork(nn.Module):
    """Axis-angle and translation from two stacked frames.

    The first convolution has stride 4 and the others 2: motion shows in coarse maps, and two poses are
    estimated for every depth. Batch normalisation behind these four is our choice, for training from random
    weights.
    """

    def __init__(self) -> None:
        super().__init__()
        self.normalization = ImageNormalization()
        layers: list[nn.Module] = []
        inputs = 6
        for outputs in POSE_CHANNELS:
            kernel, stride = (7, 4) if inputs == 6 else (3, 2)
            layers += [
                nn.Conv2d(inputs, outputs, kernel, stride, kernel // 2, bias=False),
                nn.BatchNorm2d(outputs),
                nn.ReLU(inplace=True),
            ]
            inputs = outputs
        self.features = nn.Sequential(*layers)
        self.motion = nn.Sequential(
            nn.Conv2d(inputs, REDUCED_CHANNELS, 1),
            nn.ReLU(inplace=True),
            nn.Conv2d(REDUCED_CHANNELS, REDUCED_CHANNELS, 3, padding=1),
            nn.ReLU(inplace=True),
            nn.Conv2d(REDUCED_CHANNELS, REDUCED_CHANNELS, 3, padding=1),
            nn.ReLU(inplace=True),
            nn.Conv2d(REDUCED_CHANNELS, 6, 1),
        )
        for module in self.modules():
            if isinstance(module, nn.Conv2d):
                nn.init.kaiming_normal_(module.weight, nonlinearity="relu")
                if module.bias is not None:
                    nn.init.zeros_(module.bias)

    def forward(self, first: Tensor, second: Tensor) -> Tensor:
        """(N, 6): axis-angle in radians, then translation in the unit of the depth network.

        Args:
            first, second: (N, 3, H, W), RGB in 0..1.
        """
        stacked = torch.cat([self.normalization(first), self.normalization(second)], dim=1)
        motion: Tensor = self.motion(self.features(stacked))
        return POSE_SCALE * motion.mean(dim=(2, 3))
