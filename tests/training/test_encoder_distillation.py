"""ResNet-18 learns the features of a network that knows ImageNet, and starts others from them."""

from __future__ import annotations

from pathlib import Path

import torch

from training.encoder_distillation import EncoderDistillation
from training.networks.catalogue import build_network
from training.networks.resnet import load_resnet18

_PICTURES = torch.rand(4, 3, 32, 32, generator=torch.Generator().manual_seed(0))


def test_it_comes_to_tell_the_teachers_features() -> None:
    lesson = EncoderDistillation(images=48)
    errors = [step.error for step in lesson.run([_PICTURES] * 12)]
    assert sum(errors[-3:]) < 0.7 * sum(errors[:3])


def test_it_ends_after_the_pictures_that_were_asked_for() -> None:
    steps = list(EncoderDistillation(images=6).run([_PICTURES] * 5))
    assert [step.images for step in steps] == [4, 8]


def test_what_it_saves_starts_every_resnet_network(tmp_path: Path) -> None:
    lesson = EncoderDistillation(images=4)
    list(lesson.run([_PICTURES]))
    lesson.save(tmp_path / "start.pt")
    network = build_network("monodepth2")
    load_resnet18(network, tmp_path / "start.pt")
    for name, value in lesson.student.state_dict().items():
        assert torch.equal(network.encoder.state_dict()[name], value), name
