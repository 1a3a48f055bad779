"""The two networks that learn together (section 2.1): from three frames to what the loss needs."""

from __future__ import annotations

from typing import NamedTuple

from torch import Tensor, nn

from training.networks.catalogue import build_network
from training.networks.pose_network import PoseNetwork
from training.networks.resnet import load_resnet18
from training.photometric.geometry import transform_from_pose
from training.selfsupervised.settings import NetworkSettings


class Prediction(NamedTuple):
    """What the networks say about a batch; a tuple, since Fabric looks for tensors inside.

    Args:
        disparities: four sigmoid disparities, finest first, (N, 1, H / 2^s, W / 2^s).
        source_from_target: (N, 4, 4) transforms from the target frame's camera to the previous and to the
            next frame's. Their translation has the unknown scale of the depth.
    """

    disparities: tuple[Tensor, ...]
    source_from_target: tuple[Tensor, Tensor]


class DepthAndPose(nn.Module):
    """Depth and pose network as one module, so that distributed training sees one forward pass."""

    def __init__(self, settings: NetworkSettings) -> None:
        super().__init__()
        # Pose network and encoder draw their random weights first: they start alike whatever the decoder.
        self.pose = PoseNetwork()
        self.depth = build_network(settings.name, settings.encoder)
        if settings.encoder_weights is not None:
            load_resnet18(self.depth, settings.encoder_weights)

    def forward(self, previous: Tensor, target: Tensor, following: Tensor) -> Prediction:
        """All frames (N, 3, H, W), RGB 0 to 1.

        The pose network always sees the earlier frame first, so that it learns forward motion only; the
        transform to the previous frame is the inverse of what it says.
        """
        to_previous = transform_from_pose(self.pose(previous, target), inverse=True)
        to_following = transform_from_pose(self.pose(target, following))
        return Prediction(tuple(self.depth(target)), (to_previous, to_following))
