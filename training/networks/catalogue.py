"""The self-supervised depth networks by name."""

from __future__ import annotations

from torch import nn

from training.errors import TrainingSettingsError
from training.networks.disparity import DisparityNetwork
from training.networks.hr_depth import HRDepth
from training.networks.lite_encoder import LiteEncoder
from training.networks.monodepth2 import Monodepth2
from training.networks.paper_network import Attention, PaperNetwork
from training.networks.resnet import ResNet18

_VARIANTS = {
    "bl": (False, Attention.NONE),
    "bl+fan": (True, Attention.NONE),
    "bl+fan+se": (True, Attention.SQUEEZE_EXCITATION),
    "bl+fan+eca": (True, Attention.EFFICIENT),
}
PROPOSED = "bl+fan+eca"
NETWORK_NAMES = ("monodepth2", "hr-depth", *_VARIANTS)
"""Both baselines, then the paper's ablation; its last variant is the proposed network."""

RESNET18 = "resnet18"
EFFICIENTNET_LITE0 = "efficientnet-lite0"
ENCODER_NAMES = (RESNET18, EFFICIENTNET_LITE0)


def build_network(name: str, encoder: str = RESNET18, *, pretrained: bool = True) -> DisparityNetwork:
    """A depth network with fresh weights from PyTorch's random state.

    Args:
        name: one of `NETWORK_NAMES`.
        encoder: one of `ENCODER_NAMES`; the baselines have ResNet-18 only.
        pretrained: EfficientNet-Lite0 gets its ImageNet weights; False spares that where a checkpoint is
            loaded anyway.

    Raises:
        TrainingSettingsError: no such name, or an encoder that the network cannot have.
        PretrainedWeightsError: the package with EfficientNet-Lite0's weights is missing.
    """
    if name not in NETWORK_NAMES:
        raise TrainingSettingsError(f"no network {name!r}: one of {', '.join(NETWORK_NAMES)} is needed")
    if encoder not in ENCODER_NAMES:
        raise TrainingSettingsError(f"no encoder {encoder!r}: one of {', '.join(ENCODER_NAMES)} is needed")
    if name in _VARIANTS:
        aggregation, attention = _VARIANTS[name]
        return PaperNetwork(_encoder(encoder, pretrained), aggregation=aggregation, attention=attention)
    if encoder != RESNET18:
        raise TrainingSettingsError(f"{name} has the encoder {RESNET18}, not {encoder}")
    return Monodepth2() if name == "monodepth2" else HRDepth()


def _encoder(name: str, pretrained: bool) -> nn.Module:
    return ResNet18() if name == RESNET18 else LiteEncoder(pretrained=pretrained)
