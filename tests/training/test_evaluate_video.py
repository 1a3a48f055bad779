"""`uavdepth evaluate-video` on recordings with a truth, and on KITTI's frames by a split."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import pytest
from recordings import write_wall_recording

from training.errors import CheckpointError, EvaluationError, TrainingDataError
from training.selfsupervised.depth_and_pose import DepthAndPose
from training.selfsupervised.evaluate_command import evaluate_video, measured_sequences
from training.selfsupervised.run_state import RunState
from training.selfsupervised.settings import parse_settings
from training.selfsupervised.trained_network import trained_network

KITTI = Path(__file__).parents[2].parent / "shared" / "data" / "kitti_raw"


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_wall_recording(tmp_path_factory.mktemp("recordings") / "wall", frames=4)


@pytest.fixture(scope="module")
def checkpoint(recording: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    import torch

    table = {
        "sources": [{"kind": "airsim", "path": str(recording)}],
        "network": {"name": "bl"},
        "width": 96,
        "height": 64,
        "image_steps": 8,
    }
    settings = parse_settings(table, "test")
    networks = DepthAndPose(settings.network)
    path = tmp_path_factory.mktemp("run") / "checkpoint.pt"
    RunState(settings, 1, 8, 1.0, networks.state_dict(), {}, torch.get_rng_state()).save(path)
    return path


def test_a_wall_is_measured_as_the_one_plane_that_it_is(
    checkpoint: Path, recording: Path, tmp_path: Path
) -> None:
    """A plane is constant depth: no network is better on it, and constant depth makes no error at all."""
    evaluate_video(checkpoint, "airsim", recording, None, 1, str(tmp_path / "r.json"), tmp_path / "sheet.png")
    result = json.loads((tmp_path / "r.json").read_text())
    assert result["pictures"] == 4
    assert result["network"] == "bl"
    assert result["constant_depth_median_scaled"]["abs_rel"] == 0.0
    assert result["median_scaled"]["abs_rel"] > 0.0
    assert cv2.imread(str(tmp_path / "sheet.png")) is not None


def test_the_table_names_network_and_baseline(
    checkpoint: Path, recording: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    evaluate_video(checkpoint, "airsim", recording, None, 2, None, None)
    shown = capsys.readouterr().out
    assert "bl, median-scaled" in shown
    assert "constant depth" in shown
    assert "2 pictures" in shown


def test_a_split_for_other_data_is_refused(recording: Path) -> None:
    with pytest.raises(EvaluationError, match="kitti-raw"):
        measured_sequences("airsim", recording, recording / "split.txt")


def test_a_missing_split_is_named(tmp_path: Path, recording: Path) -> None:
    with pytest.raises(TrainingDataError):
        measured_sequences("kitti-raw", recording, tmp_path / "eigen.txt")


def test_weights_of_another_network_are_refused(checkpoint: Path) -> None:
    state = RunState.load(checkpoint)
    state.networks.pop("depth.heads.0.weight")
    with pytest.raises(CheckpointError, match=r"not those of bl"):
        trained_network(state)


@pytest.mark.skipif(not KITTI.is_dir(), reason="no KITTI sample beside the project")
def test_kittis_frames_are_chosen_by_a_split(checkpoint: Path, tmp_path: Path) -> None:
    drive = "2011_09_26/2011_09_26_drive_0002_sync"
    first = min(int(path.stem) for path in (KITTI / drive / "image_02" / "data").glob("*.png"))
    split = tmp_path / "eigen.txt"
    split.write_text(f"{drive} {first + 2:010d} l\n{drive} {first + 5:010d} l\n")
    evaluate_video(checkpoint, "kitti-raw", KITTI, split, 1, str(tmp_path / "r.json"), None)
    result = json.loads((tmp_path / "r.json").read_text())
    assert result["pictures"] == 2
    assert 0.2 < result["constant_depth_median_scaled"]["abs_rel"] < 0.6
