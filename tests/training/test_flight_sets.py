"""Rendered flights in AirSim's layout: the paper's counts and camera, and what a reader finds in them."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from training.data.flight_sets import (
    AIRSIM_CAMERA,
    COMPARISON_SETS,
    FRAMES_PER_S,
    FlightSet,
    write_flight_set,
)
from training.data.seed_split import SeedSplit
from training.photometric.geometry import reproject
from training.sequences.airsim import AirSimRecording, open_airsim
from training.sequences.triplets import TripletSet


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> AirSimRecording:
    root = tmp_path_factory.mktemp("flights")
    write_flight_set(root, FlightSet("wall", 1000, 1, 4, with_depth=True))
    (found,) = open_airsim(root)
    return found


@pytest.mark.parametrize(
    ("name", "frames"),
    [("mountain-train", 3986), ("mountain-test", 1453), ("city-train", 3174), ("city-test", 1206)],
)
def test_sets_have_the_papers_counts(name: str, frames: int) -> None:
    assert sum(count for _, count in COMPARISON_SETS[name].flights()) == frames


def test_no_test_world_is_a_training_world() -> None:
    for name, wanted in COMPARISON_SETS.items():
        split = SeedSplit.TEST if name.endswith("test") else SeedSplit.TRAIN
        assert all(seed in split.value for seed, _ in wanted.flights())


def test_the_camera_is_that_of_equation_12(recording: AirSimRecording) -> None:
    assert recording.camera == AIRSIM_CAMERA
    assert recording.image_bgr(0).shape == (480, 640, 3)


def test_every_inner_frame_makes_a_triplet(recording: AirSimRecording) -> None:
    triplets = TripletSet.from_sequences([recording])
    assert [triplet.index for triplet in triplets.triplets] == [1, 2]
    assert triplets.skipped == ()


def test_depth_and_poses_rebuild_a_frame_from_the_next(recording: AirSimRecording) -> None:
    """The recorded poses, read back from their quaternions, are those that the pictures were taken from."""
    import torch

    def tensor(values: np.ndarray) -> torch.Tensor:
        return torch.from_numpy(np.ascontiguousarray(values)).float()[None]

    pictures = [tensor(recording.image_bgr(i).transpose(2, 0, 1)) / 255 for i in (0, 1)]
    depth = recording.truth_m(0)
    assert depth is not None
    depth = np.where(np.isfinite(depth), depth, 1e4)
    move = np.linalg.inv(recording.world_from_camera(1)) @ recording.world_from_camera(0)
    camera = tensor(recording.camera.matrix)
    rebuilt = reproject(pictures[1], tensor(depth[None]), camera, tensor(move))
    still = reproject(pictures[1], tensor(depth[None]), camera, tensor(np.eye(4)))
    seen = slice(60, -60)
    errors = [float((each - pictures[0])[..., seen, seen].abs().mean()) for each in (rebuilt, still)]
    assert errors[0] < 0.4 * errors[1]


def test_time_stamps_follow_the_frame_rate(recording: AirSimRecording) -> None:
    path = recording.file_of(0).parent.parent / "airsim_rec.txt"
    stamps = [int(line.split("\t")[1]) for line in path.read_text().splitlines()[1:]]
    assert all(b - a == round(1000 / FRAMES_PER_S) for a, b in pairwise(stamps))


def test_what_is_there_is_not_rendered_again(recording: AirSimRecording) -> None:
    root: Path = recording.file_of(0).parent.parent.parent
    before = recording.file_of(0).stat().st_mtime_ns
    write_flight_set(root, FlightSet("wall", 1000, 1, 4, with_depth=True))
    assert recording.file_of(0).stat().st_mtime_ns == before
