"""Export: what flies is what was trained."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import onnx
import pytest
import torch
from small_runs import two_steps

import training.export
from training.checkpoint import Checkpoint
from training.commands import export
from training.data.batches import network_image
from training.data.hint_sampling import hint_maps
from training.data.views import View
from training.errors import CheckpointError, ExportError
from training.export import export_checkpoint
from training.half_weights import SMALLEST_HALVED, rounded_network
from training.networks.blocks import upsample
from training.networks.hint_levels import hint_levels
from training.normalization import MAX_DEPTH_M, depth_from_output
from uavdepth.attitude import Attitude
from uavdepth.camera import CameraModel, CameraMount
from uavdepth.errors import ModelCardError
from uavdepth.model.card import CARD_METADATA_KEY
from uavdepth.model.depth_model import DepthModel
from uavdepth.model.hints import GroundHint, Hints, PointHints
from uavdepth.model.point_fit import fit_to_points
from uavdepth.model.point_pixels import PointPixels

SIZE = (128, 64)
"""Another than that of the run: every size comes from one checkpoint."""

SIGMA_FACTOR = 0.5
"""A calibration's: the file's sigma is so much of the trained one's."""


@pytest.fixture(scope="module")
def checkpoint(tmp_path_factory: pytest.TempPathFactory) -> Checkpoint:
    return two_steps(tmp_path_factory.mktemp("frames"))


@pytest.fixture(scope="module")
def exported(checkpoint: Checkpoint, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("export") / "network.onnx"
    measured = {"median_scaled": {"abs_rel": 0.25}}
    export_checkpoint(checkpoint, path, "narrow", measured, SIZE, SIGMA_FACTOR, "two photographs (CC0)")
    return path


def test_the_card_says_what_the_file_is(checkpoint: Checkpoint, exported: Path) -> None:
    card = DepthModel.load(exported, provider="cpu").card
    assert (card.name, card.input_width, card.input_height) == ("narrow", *SIZE)
    assert (card.card_version, card.hints) == (2, ("ground", "points"))
    assert (card.layout, card.hint_layout) == ("nhwc", "levels")
    assert (card.output, card.metric, card.uncertainty) == ("log_inverse_depth", True, True)
    assert card.max_depth_m == MAX_DEPTH_M
    assert card.measured == {"median_scaled": {"abs_rel": 0.25}}
    assert f"{checkpoint.images} pictures" in card.effort
    assert f"{checkpoint.frames} rendered frames" in card.training_data
    assert card.training_data.endswith("; two photographs (CC0)")


def test_levels_of_another_size_than_the_cards_are_refused(exported: Path, tmp_path: Path) -> None:
    model = onnx.load(exported)
    entry = next(entry for entry in model.metadata_props if entry.key == CARD_METADATA_KEY)
    entry.value = entry.value.replace('"input_width": 128', '"input_width": 160')
    onnx.save(model, tmp_path / "other.onnx")
    text = r"'hints_4' is tensor\(float\) \[1, 5, 16, 32\]: float32 \[1, 5, 16, 40\] is needed"
    with pytest.raises(ModelCardError, match=text):
        DepthModel.load(tmp_path / "other.onnx", provider="cpu")


def some_hints(camera: CameraModel) -> Hints:
    rng = np.random.default_rng(2)
    pixels = rng.uniform((0, 0), (camera.width - 1, camera.height - 1), (40, 2))
    points = PointHints(pixels, rng.uniform(2.0, 30.0, 40), rng.uniform(0.02, 0.2, 40))
    return Hints(GroundHint(CameraMount(pitch_deg=-10.0), Attitude(0.1, 0.0, 0.0), 4.0), points)


@pytest.mark.parametrize("hinted", [False, True])
def test_flight_draws_the_depth_that_training_meant_to_the_points_and_scales_sigma_as_calibrated(
    checkpoint: Checkpoint, exported: Path, hinted: bool
) -> None:
    camera = CameraModel.from_fov(*SIZE, 75.0)
    hints = some_hints(camera) if hinted else Hints()
    picture = np.random.default_rng(1).integers(0, 256, (SIZE[1], SIZE[0], 3), dtype=np.uint8)
    view = View(camera, CameraMount(), Attitude(0.0, 0.0, 0.0))
    planes = (network_image(picture), *hint_maps(hints, view, *SIZE))
    image, *maps = (torch.from_numpy(plane)[None] for plane in planes)
    with torch.no_grad():
        half = checkpoint.averaged_network().at_half_size(image, hint_levels(*maps))
    half_sigma = SIGMA_FACTOR * np.exp(half.log_sigma[0, 0].numpy())
    drawn = half.log_inverse_depth[0, 0].numpy()
    drawn = fit_to_points(drawn, half_sigma, PointPixels.of_planes(planes[2]))
    wanted = depth_from_output(upsample(torch.from_numpy(drawn)[None, None])[0, 0].numpy(), camera.fx)
    sigma = SIGMA_FACTOR * np.exp(upsample(half.log_sigma)[0, 0].numpy())
    answer = DepthModel.load(exported, provider="cpu").infer(picture, camera, hints)
    known = np.isfinite(answer.depth_m) & (wanted < MAX_DEPTH_M)
    assert known.any()
    # The checkpoint is in single precision, the file in half.
    assert np.abs(np.log(answer.depth_m[known] / wanted[known])).mean() < 2e-3
    assert answer.relative_sigma is not None
    assert np.allclose(answer.relative_sigma[known], sigma[known], rtol=1e-2)


def test_large_weights_are_stored_in_half_precision_and_small_ones_are_not(exported: Path) -> None:
    stored = {item.name: item for item in onnx.load(exported).graph.initializer}
    sizes = {name: math.prod(item.dims) for name, item in stored.items()}
    halved = {name for name, item in stored.items() if item.data_type == onnx.TensorProto.FLOAT16}
    assert halved == {
        name
        for name, item in stored.items()
        if sizes[name] >= SMALLEST_HALVED and item.data_type != onnx.TensorProto.INT64
    }
    assert sum(sizes[name] for name in halved) > 0.7 * sum(sizes.values())


def test_the_rounded_network_leaves_the_trained_one_as_it_is(checkpoint: Checkpoint) -> None:
    network = checkpoint.averaged_network()
    before = {name: value.clone() for name, value in network.state_dict().items()}
    rounded = rounded_network(network)
    assert all(torch.equal(before[name], value) for name, value in network.state_dict().items())
    for parameter in rounded.parameters():
        if parameter.numel() >= SMALLEST_HALVED:
            assert torch.equal(parameter, parameter.half().float())


def test_a_weight_that_half_precision_cannot_hold_is_named(checkpoint: Checkpoint) -> None:
    network = checkpoint.averaged_network()
    name, large = next(item for item in network.named_parameters() if item[1].numel() >= SMALLEST_HALVED)
    with torch.no_grad():
        large.view(-1)[0] = 1e6
    with pytest.raises(ExportError, match=f"{name} reaches 1e\\+06"):
        rounded_network(network)


@pytest.mark.parametrize("size", [(100, 64), (96, 33), (32, 64)])
def test_a_size_that_the_network_cannot_take_is_refused(
    checkpoint: Checkpoint, tmp_path: Path, size: tuple[int, int]
) -> None:
    with pytest.raises(ExportError, match=f"{size[0]}x{size[1]}"):
        export_checkpoint(checkpoint, tmp_path / "out.onnx", "narrow", size=size)
    assert list(tmp_path.iterdir()) == []


def test_a_file_that_computes_something_else_does_not_take_its_place(
    checkpoint: Checkpoint, exported: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    wrong = onnx.load(exported)
    (bias,) = [item for item in wrong.graph.initializer if item.name.endswith("correction.output.bias")]
    bias.CopyFrom(
        onnx.numpy_helper.from_array(onnx.numpy_helper.to_array(bias) + np.float32(0.01), bias.name)
    )
    monkeypatch.setattr(training.export, "_to_onnx", lambda network, card: wrong)
    (tmp_path / "out.onnx").write_bytes(b"the old one")
    with pytest.raises(ExportError, match="differs from PyTorch's"):
        export_checkpoint(checkpoint, tmp_path / "out.onnx", "narrow", size=SIZE, sigma_factor=SIGMA_FACTOR)
    assert (tmp_path / "out.onnx").read_bytes() == b"the old one"
    assert len(list(tmp_path.iterdir())) == 1


def test_nothing_of_the_training_machine_is_in_the_file(exported: Path) -> None:
    content = exported.read_bytes()
    for trace in (b"site-packages", b".py", str(Path(__file__).parent.parent).encode()):
        assert trace not in content


def test_a_missing_checkpoint_writes_nothing(tmp_path: Path) -> None:
    with pytest.raises(CheckpointError, match=r"none\.pt"):
        export(tmp_path / "out.onnx", checkpoint=tmp_path / "none.pt", name="narrow")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("factor", [0.0, -1.0, math.nan, math.inf])
def test_a_factor_of_sigma_that_is_none_is_refused(
    checkpoint: Checkpoint, tmp_path: Path, factor: float
) -> None:
    with pytest.raises(ExportError, match="factor of sigma"):
        export_checkpoint(checkpoint, tmp_path / "net.onnx", "narrow", size=SIZE, sigma_factor=factor)
