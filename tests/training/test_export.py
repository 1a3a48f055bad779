"""Export: what flies is what was trained."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import torch
from frames import make_store

from training.checkpoint import Checkpoint
from training.commands import export
from training.data.batches import FramePool, network_image
from training.errors import CheckpointError, EvaluationError
from training.export import export_checkpoint
from training.networks.depth_network import NetworkShape
from training.normalization import MAX_DEPTH_M, depth_from_output
from training.settings import SizePhase, TrainingSettings
from training.trainer import Trainer
from uavdepth.camera import CameraModel
from uavdepth.depth_model import DepthModel


@pytest.fixture(scope="module")
def checkpoint(tmp_path_factory: pytest.TempPathFactory) -> Checkpoint:
    """Two steps of a narrow network."""
    settings = TrainingSettings(
        images=4,
        phases=(SizePhase(1.0, 96, 64, 2),),
        large=None,
        shape=NetworkShape(
            channels=(4, 4, 4, 4, 4),
            head_channels=4,
            frozen_stages=6,
            hint_channels=(4, 4, 4, 4, 4),
            correction_channels=4,
        ),
        precision="fp32",
    )
    trainer = Trainer(settings, FramePool(make_store(tmp_path_factory.mktemp("frames"))), pretrained=False)
    list(trainer.run())
    return trainer.checkpoint()


@pytest.fixture(scope="module")
def exported(checkpoint: Checkpoint, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("export") / "network.onnx"
    export_checkpoint(checkpoint, path, "narrow", {"median_scaled": {"abs_rel": 0.25}})
    return path


def test_the_card_says_what_the_file_is(checkpoint: Checkpoint, exported: Path) -> None:
    card = DepthModel.load(exported, provider="cpu").card
    assert (card.name, card.input_width, card.input_height) == ("narrow", 96, 64)
    assert (card.output, card.metric, card.uncertainty) == ("log_inverse_depth", True, True)
    assert card.max_depth_m == MAX_DEPTH_M
    assert card.measured == {"median_scaled": {"abs_rel": 0.25}}
    assert f"{checkpoint.images} pictures" in card.training_data


def test_flight_gives_the_depth_that_training_meant(checkpoint: Checkpoint, exported: Path) -> None:
    camera = CameraModel.from_fov(96, 64, 75.0)
    picture = np.random.default_rng(1).integers(0, 256, (64, 96, 3), dtype=np.uint8)
    with torch.no_grad():
        output = checkpoint.averaged_network()(torch.from_numpy(network_image(picture))[None])
    wanted = depth_from_output(output.log_inverse_depth[0, 0].numpy(), camera.fx)
    answer = DepthModel.load(exported, provider="cpu").infer(picture, camera)
    known = np.isfinite(answer.depth_m)
    assert known.any()
    assert np.allclose(answer.depth_m[known], wanted[known], rtol=2e-3)
    assert answer.relative_sigma is not None
    assert np.allclose(answer.relative_sigma[known], np.exp(output.log_sigma[0, 0].numpy())[known], rtol=2e-3)


def test_nothing_of_the_training_machine_is_in_the_file(exported: Path) -> None:
    content = exported.read_bytes()
    for trace in (b"site-packages", b".py", str(Path(__file__).parent.parent).encode()):
        assert trace not in content


def test_the_command_writes_measured_errors_into_the_card(checkpoint: Checkpoint, tmp_path: Path) -> None:
    checkpoint.save(tmp_path / "checkpoint.pt")
    (tmp_path / "errors.json").write_text(json.dumps({"summary": {"frames": 7}}))
    export(
        tmp_path / "out.onnx",
        checkpoint=tmp_path / "checkpoint.pt",
        name="narrow",
        measured=tmp_path / "errors.json",
    )
    assert DepthModel.load(tmp_path / "out.onnx", provider="cpu").card.measured == {"frames": 7}


@pytest.mark.parametrize("text", [None, "{", "{}", "[]"])
def test_errors_that_were_not_measured_are_refused(
    checkpoint: Checkpoint, tmp_path: Path, text: str | None
) -> None:
    checkpoint.save(tmp_path / "checkpoint.pt")
    if text is not None:
        (tmp_path / "errors.json").write_text(text)
    with pytest.raises(EvaluationError, match=r"errors\.json"):
        export(
            tmp_path / "out.onnx",
            checkpoint=tmp_path / "checkpoint.pt",
            name="narrow",
            measured=tmp_path / "errors.json",
        )
    assert not (tmp_path / "out.onnx").exists()


def test_a_missing_checkpoint_writes_nothing(tmp_path: Path) -> None:
    with pytest.raises(CheckpointError, match=r"none\.pt"):
        export(tmp_path / "out.onnx", checkpoint=tmp_path / "none.pt", name="narrow", measured=None)
    assert list(tmp_path.iterdir()) == []
