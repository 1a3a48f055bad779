"""What is compared, and the budget that every network has."""

from __future__ import annotations

from pathlib import Path

from training.selfsupervised.settings import SelfSupervisedSettings, parse_settings

WIDTH, HEIGHT = 128, 96
"""A fifth of the recorded 640x480: the largest size at which all six runs take hours, not days, on a CPU."""

IMAGE_STEPS = 30_000
BATCH = 8
SMOOTHNESS = 0.001
"""Monodepth2's. With the paper's 0.04 the depth of Monodepth2 was still one plane after 4,000 pictures of
this size (Abs Rel as of constant depth), with 0.001 it had begun to have a shape after 3,200."""

START_IMAGES = 16_000
"""Pictures shown to the encoder that all networks start from."""

SCENES = ("mountain", "city")
START_FILE = "resnet18-start.pt"
RESULTS = Path("docs/comparison")
"""Where the committed results lie, seen from the project's folder."""


def run_settings(network: str, data: Path) -> SelfSupervisedSettings:
    """Settings of one network's run; nothing but the network differs.

    All but the smoothness is the paper's: Adam at 1e-4, at 1e-5 for the last quarter, batch 8.

    Args:
        network: one of `training.networks.catalogue.NETWORK_NAMES`.
        data: folder of the rendered sets; the encoder to start from lies there too.
    """
    table = {
        "sources": [{"kind": "airsim", "path": str(data / f"{scene}-train")} for scene in SCENES],
        "loss": {"smoothness": SMOOTHNESS},
        "network": {"name": network, "encoder_weights": str(data / START_FILE)},
        "width": WIDTH,
        "height": HEIGHT,
        "batch": BATCH,
        "image_steps": IMAGE_STEPS,
        "cache": str(data / "cache"),
    }
    return parse_settings(table, f"the comparison's run of {network}")
