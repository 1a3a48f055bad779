"""The ResNet-18 encoder: torchvision's names, its five maps, and weight files good and bad."""

from __future__ import annotations

import os
from collections import OrderedDict
from collections.abc import Callable
from pathlib import Path

import pytest
import torch
from torch import Tensor

from training.errors import PretrainedWeightsError
from training.networks.catalogue import build_network
from training.networks.image_normalization import IMAGENET_MEAN, IMAGENET_STD, ImageNormalization
from training.networks.pose_network import PoseNetwork
from training.networks.resnet import RESNET18_CHANNELS, ResNet18, load_resnet18

State = dict[str, Tensor]


def _norm_shapes(name: str, channels: int) -> dict[str, tuple[int, ...]]:
    each = dict.fromkeys(("weight", "bias", "running_mean", "running_var"), (channels,))
    return {f"{name}.{key}": shape for key, shape in (each | {"num_batches_tracked": ()}).items()}


def torchvision_shapes() -> dict[str, tuple[int, ...]]:
    """Every entry of torchvision's resnet18 without its classifier, by the rule that its names follow."""
    shapes: dict[str, tuple[int, ...]] = {"conv1.weight": (64, 3, 7, 7), **_norm_shapes("bn1", 64)}
    inputs = 64
    for layer, channels in enumerate((64, 128, 256, 512), start=1):
        for block in (0, 1):
            prefix = f"layer{layer}.{block}"
            for number in (1, 2):
                shapes[f"{prefix}.conv{number}.weight"] = (channels, inputs, 3, 3)
                shapes |= _norm_shapes(f"{prefix}.bn{number}", channels)
                if number == 1 and inputs != channels:
                    shapes[f"{prefix}.downsample.0.weight"] = (channels, inputs, 1, 1)
                    shapes |= _norm_shapes(f"{prefix}.downsample.1", channels)
                inputs = channels
    return shapes


def torchvision_state(seed: int = 0) -> State:
    """Random entries of those names and shapes, classifier included."""
    generator = torch.Generator().manual_seed(seed)
    state: State = OrderedDict()
    for name, shape in torchvision_shapes().items():
        state[name] = torch.rand(shape, generator=generator) if shape else torch.tensor(7)
    state["fc.weight"] = torch.zeros(1000, 512)
    state["fc.bias"] = torch.zeros(1000)
    return state


def test_names_and_shapes_are_torchvisions() -> None:
    own = {name: tuple(value.shape) for name, value in ResNet18().state_dict().items()}
    assert own == torchvision_shapes()


def test_parameters_are_those_of_resnet18_without_its_classifier() -> None:
    assert sum(parameter.numel() for parameter in ResNet18().parameters()) == 11_689_512 - 513_000


def test_five_maps_from_half_to_a_thirtysecond() -> None:
    with torch.no_grad():
        maps = ResNet18().eval()(torch.rand(2, 3, 64, 96))
    assert [tuple(item.shape) for item in maps] == [
        (2, channels, 64 >> level, 96 >> level) for level, channels in enumerate(RESNET18_CHANNELS, start=1)
    ]


def test_no_map_is_overwritten_by_the_next_layer() -> None:
    encoder = ResNet18().eval()
    picture = torch.rand(1, 3, 64, 64)
    with torch.no_grad():
        maps = encoder(picture)
        stem = torch.relu(encoder.bn1(encoder.conv1(encoder.normalization(picture))))
        third = encoder.layer2(maps[1])
    assert torch.equal(maps[0], stem)
    assert torch.equal(maps[2], third)


def test_the_encoder_sees_what_imagenet_training_saw() -> None:
    mean = torch.tensor(IMAGENET_MEAN).reshape(1, 3, 1, 1)
    std = torch.tensor(IMAGENET_STD).reshape(1, 3, 1, 1)
    normalization = ImageNormalization()
    assert torch.allclose(normalization(mean), torch.zeros(1, 3, 1, 1), atol=1e-6)
    assert torch.allclose(normalization(mean + std), torch.ones(1, 3, 1, 1), atol=1e-5)


def test_random_weights_keep_the_size_of_what_passes_back() -> None:
    torch.manual_seed(1)
    weight = ResNet18().get_parameter("layer3.0.conv2.weight")
    assert weight.std().item() == pytest.approx((2.0 / (256 * 9)) ** 0.5, rel=0.02)


@pytest.mark.parametrize("name", ["monodepth2", "bl+fan+eca"])
def test_a_torchvision_file_fills_the_encoder_and_nothing_else(name: str, tmp_path: Path) -> None:
    state = torchvision_state()
    torch.save(state, tmp_path / "resnet18.pth")
    network = build_network(name)
    before = {key: value.clone() for key, value in network.state_dict().items()}
    load_resnet18(network, tmp_path / "resnet18.pth")
    for key, value in network.state_dict().items():
        of_encoder = key.removeprefix("encoder.")
        wanted = state[of_encoder] if key.startswith("encoder.") else before[key]
        assert torch.equal(value, wanted), key


def test_files_from_before_batches_were_counted_load(tmp_path: Path) -> None:
    state = {key: value for key, value in torchvision_state().items() if "num_batches" not in key}
    torch.save(state, tmp_path / "old.pth")
    encoder = ResNet18()
    load_resnet18(encoder, tmp_path / "old.pth")
    assert torch.equal(encoder.get_buffer("layer4.1.bn2.running_var"), state["layer4.1.bn2.running_var"])


def _without(state: State) -> State:
    del state["layer3.0.downsample.0.weight"]
    return state


def _other_shape(state: State) -> State:
    return state | {"layer1.0.conv1.weight": torch.zeros(64, 64, 1, 1)}


def _deeper(state: State) -> State:
    return state | {"layer1.2.conv1.weight": torch.zeros(64, 64, 3, 3)}


def _not_finite(state: State) -> State:
    state["bn1.running_var"][5] = float("nan")
    return state


@pytest.mark.parametrize(
    ("damage", "complaint"),
    [
        (_without, r"no entry 'layer3\.0\.downsample\.0\.weight'"),
        (_other_shape, r"layer1\.0\.conv1\.weight has shape \(64, 64, 1, 1\).*needs \(64, 64, 3, 3\)"),
        (_deeper, r"'layer1\.2\.conv1\.weight' is no entry"),
        (_not_finite, r"bn1\.running_var holds numbers that are not finite"),
        (lambda state: {"state_dict": state}, "not a state dict"),
        (lambda state: list(state.values()), "not a state dict"),
    ],
)
def test_weights_that_do_not_fit_change_nothing(
    damage: Callable[[State], object], complaint: str, tmp_path: Path
) -> None:
    path = tmp_path / "odd.pth"
    torch.save(damage(torchvision_state()), path)
    encoder = ResNet18()
    before = {key: value.clone() for key, value in encoder.state_dict().items()}
    with pytest.raises(PretrainedWeightsError, match=complaint) as caught:
        load_resnet18(encoder, path)
    assert "odd.pth" in str(caught.value)
    assert all(torch.equal(value, before[key]) for key, value in encoder.state_dict().items())


@pytest.mark.parametrize(
    "content",
    [b"", b"\x00", b"<!doctype html><html>not found</html>", b"PK\x03\x04 cut off", b"\x80\x02}q\x00"],
)
def test_a_file_without_weights_is_named(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "page.pth"
    path.write_bytes(content)
    with pytest.raises(PretrainedWeightsError, match=r"page\.pth is not a file of weights"):
        load_resnet18(ResNet18(), path)


def test_a_file_that_would_run_code_is_refused(tmp_path: Path) -> None:
    class Payload:
        def __reduce__(self) -> tuple[object, ...]:
            return os.mkdir, (str(tmp_path / "executed"),)

    torch.save({"conv1.weight": Payload()}, tmp_path / "evil.pth")
    with pytest.raises(PretrainedWeightsError, match=r"evil\.pth is not a file of weights"):
        load_resnet18(ResNet18(), tmp_path / "evil.pth")
    assert not (tmp_path / "executed").exists()


@pytest.mark.parametrize("name", ["nothing.pth", "."])
def test_a_file_that_cannot_be_read_is_named(name: str, tmp_path: Path) -> None:
    with pytest.raises(PretrainedWeightsError, match="cannot read the encoder weights"):
        load_resnet18(ResNet18(), tmp_path / name)


def test_a_network_without_resnet18_takes_no_such_weights(tmp_path: Path) -> None:
    torch.save(torchvision_state(), tmp_path / "resnet18.pth")
    with pytest.raises(PretrainedWeightsError, match="PoseNetwork"):
        load_resnet18(PoseNetwork(), tmp_path / "resnet18.pth")
    with pytest.raises(PretrainedWeightsError, match="LiteEncoder"):
        load_resnet18(build_network("bl", "efficientnet-lite0", pretrained=False), tmp_path / "resnet18.pth")
