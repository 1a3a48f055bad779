"""One door to all recordings and data sets."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from training.errors import TrainingDataError
from training.sequences.airsim import open_airsim
from training.sequences.calibration import NO_CALIBRATION, Calibration
from training.sequences.frame_sequence import FrameSequence
from training.sequences.kitti_odometry import open_kitti_odometry
from training.sequences.kitti_raw import open_kitti_raw
from training.sequences.picture_folder import open_folder
from training.sequences.record import open_record
from training.sequences.split_file import read_split, split_triplets
from training.sequences.tartanair import open_tartanair
from training.sequences.triplets import TripletSet
from training.sequences.video import open_video

_CALIBRATED: Mapping[str, Callable[[Path], Sequence[FrameSequence]]] = {
    "kitti-raw": open_kitti_raw,
    "kitti-odometry": open_kitti_odometry,
    "tartanair": open_tartanair,
    "record": open_record,
}
_UNCALIBRATED: Mapping[str, Callable[[Path, Calibration], Sequence[FrameSequence]]] = {
    "airsim": open_airsim,
    "video": open_video,
    "folder": open_folder,
}

SEQUENCE_KINDS = (*_UNCALIBRATED, *_CALIBRATED)
"""What `open_sequences` knows."""


def open_sequences(kind: str, path: Path, calibration: Calibration = NO_CALIBRATION) -> list[FrameSequence]:
    """The sequences at a path.

    Args:
        kind: one of `SEQUENCE_KINDS`.
        path: folder or file.
        calibration: of "airsim" recordings, "video" and "folder" that bring none.

    Raises:
        TrainingDataError: an unknown kind, a calibration for a data set that has its own, or whatever the
            reader finds missing or broken.
    """
    if kind in _UNCALIBRATED:
        return list(_UNCALIBRATED[kind](path, calibration))
    if kind not in _CALIBRATED:
        raise TrainingDataError(f"no data is of kind {kind!r}; there are {', '.join(SEQUENCE_KINDS)}")
    if calibration != NO_CALIBRATION:
        raise TrainingDataError(f"{kind} brings its own calibration: give none")
    return list(_CALIBRATED[kind](path))


def open_triplets(
    kind: str, path: Path, calibration: Calibration = NO_CALIBRATION, split: Path | None = None
) -> TripletSet:
    """The triplets at a path: all of them, or those of a split file.

    Args:
        kind, path, calibration: as for `open_sequences`.
        split: file of frames, for "kitti-raw" only.

    Raises:
        TrainingDataError: as `open_sequences`, a split file that is missing or broken, or no triplet.
    """
    if split is None:
        return TripletSet.from_sequences(open_sequences(kind, path, calibration))
    if kind != "kitti-raw":
        raise TrainingDataError(f"split files are for kitti-raw, not for {kind}")
    lines = read_split(split)
    return split_triplets(open_kitti_raw(path), lines)
