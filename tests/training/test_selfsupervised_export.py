"""What video has taught flies as a relative network."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch

from training.commands import export
from training.errors import ExportError
from training.networks.catalogue import build_network
from training.networks.disparity import disparity_to_depth
from training.selfsupervised.export import export_run
from training.selfsupervised.run_state import RunState
from training.selfsupervised.settings import parse_settings
from training.selfsupervised.trained_network import trained_network
from uavdepth.camera import CameraModel
from uavdepth.model.depth_model import DepthModel

SIZE = (96, 64)


@pytest.fixture(scope="module")
def state() -> RunState:
    """An untrained network's: nothing here depends on what it has learnt."""
    settings = parse_settings(
        {
            "sources": [{"kind": "folder", "path": "pictures"}],
            "network": {"name": "monodepth2"},
            "width": SIZE[0],
            "height": SIZE[1],
            "image_steps": 8,
        },
        "test",
    )
    torch.manual_seed(0)
    network = build_network("monodepth2", "resnet18", pretrained=False)
    weights = {f"depth.{name}": value for name, value in network.state_dict().items()}
    return RunState(settings, 1, 8, 1.0, weights, {}, torch.get_rng_state())


@pytest.fixture(scope="module")
def exported(state: RunState, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """By the command, from the checkpoint's file."""
    folder = tmp_path_factory.mktemp("export")
    state.save(folder / "checkpoint.pt")
    path = folder / "net.onnx"
    export(path, checkpoint=folder / "checkpoint.pt")
    return path


def test_depth_is_that_of_the_trained_network_up_to_one_factor(state: RunState, exported: Path) -> None:
    model = DepthModel.load(exported, provider="cpu")
    assert (model.card.output, model.card.metric, model.card.uncertainty) == (
        "relative_inverse_depth",
        False,
        False,
    )
    assert (model.card.name, model.card.input_width, model.card.input_height) == ("monodepth2", *SIZE)
    assert "8 pictures" in model.card.effort
    picture = np.random.default_rng(1).integers(0, 256, (SIZE[1], SIZE[0], 3), dtype=np.uint8)
    depth = model.infer(picture, CameraModel.from_fov(*SIZE, 80.0)).depth_m
    rgb = torch.from_numpy(picture[..., ::-1].transpose(2, 0, 1) / np.float32(255.0))[None]
    with torch.no_grad():
        wanted = disparity_to_depth(trained_network(state)(rgb)[0])[0, 0].numpy()
    factor = depth / wanted
    assert factor.std() / factor.mean() < 2e-3


def test_a_size_that_the_network_cannot_take_is_refused(state: RunState, tmp_path: Path) -> None:
    with pytest.raises(ExportError, match="100x64"):
        export_run(state, tmp_path / "net.onnx", "net", (100, 64))
    assert list(tmp_path.iterdir()) == []


def test_sigma_that_there_is_not_cannot_be_calibrated(exported: Path, tmp_path: Path) -> None:
    with pytest.raises(ExportError, match="train-video"):
        export(
            tmp_path / "net.onnx",
            checkpoint=exported.with_name("checkpoint.pt"),
            calibrate=tmp_path / "frames",
        )
    assert list(tmp_path.iterdir()) == []
