"""Which frames make triplets, and which are left out and said to be."""

from __future__ import annotations

from pathlib import Path

import pytest
from sequence_files import CAMERA, CountedSequence, write_airsim, write_picture

from training.errors import TrainingDataError
from training.sequences.airsim import open_airsim
from training.sequences.calibration import Calibration
from training.sequences.picture_folder import open_folder
from training.sequences.static_frames import leave_out_static
from training.sequences.triplets import TripletSet


def test_every_frame_with_two_neighbours_of_its_own_sequence_is_a_target(tmp_path: Path) -> None:
    for name, count in (("a", 4), ("b", 5)):
        write_airsim(tmp_path / name, count)
    triplets = TripletSet.from_sequences(open_airsim(tmp_path))
    assert [(t.sequence.name, t.index) for t in triplets.triplets] == [
        ("a", 1),
        ("a", 2),
        ("b", 1),
        ("b", 2),
        ("b", 3),
    ]
    assert triplets.skipped == ()


def test_triplets_around_missing_and_empty_pictures_are_left_out_and_the_files_named(tmp_path: Path) -> None:
    images = write_airsim(tmp_path, 10) / "images"
    (images / "img_0.png").unlink()
    (images / "img_5.png").write_bytes(b"")
    triplets = TripletSet.from_sequences(open_airsim(tmp_path))
    assert [triplet.index for triplet in triplets.triplets] == [2, 3, 7, 8]
    assert [(Path(file).name, reason) for file, reason in triplets.skipped] == [
        ("img_0.png", "No such file or directory"),
        ("img_5.png", "empty file"),
    ]


def test_sequences_without_a_triplet_are_refused_with_the_first_reason(tmp_path: Path) -> None:
    images = write_airsim(tmp_path, 4) / "images"
    (images / "img_1.png").unlink()
    with pytest.raises(TrainingDataError, match=r"4 frames hold no three .*img_1\.png: No such file"):
        TripletSet.from_sequences(open_airsim(tmp_path))


def test_triplets_of_a_camera_that_stands_still_are_left_out(tmp_path: Path) -> None:
    pictures = tmp_path / "pictures"
    for index, number in enumerate((0, 1, 2, 2, 2, 3, 4)):
        write_picture(pictures / f"{index}.png", number)
    triplets = TripletSet.from_sequences(open_folder(pictures, Calibration(CAMERA)))
    moving = leave_out_static(triplets, 1.0, tmp_path / "cache", 32, 24)
    assert [triplet.index for triplet in moving.triplets] == [1, 5]
    assert [Path(file).name for file, _ in moving.skipped] == ["2.png", "3.png", "4.png"]
    assert moving.skipped[0].reason == "static: 0.00 of 255 levels from its neighbour"


def test_a_recording_that_never_moves_is_refused(tmp_path: Path) -> None:
    triplets = TripletSet.from_sequences(open_airsim(write_airsim(tmp_path / "flight")))
    with pytest.raises(TrainingDataError, match="all 4 triplets are static"):
        leave_out_static(triplets, 255.0, tmp_path / "cache", 32, 24)


def test_looking_for_static_frames_leaves_out_what_cannot_be_decoded(tmp_path: Path) -> None:
    (recording,) = open_airsim(write_airsim(tmp_path / "flight", 8))
    sequence = CountedSequence(recording, [], frozenset({2}))
    moving = leave_out_static(TripletSet.from_sequences([sequence]), 0.1, tmp_path / "cache", 32, 24)
    assert [triplet.index for triplet in moving.triplets] == [4, 5, 6]
    assert {reason for _, reason in moving.skipped} == {"frame 2 is broken"}
