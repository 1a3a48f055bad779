"""The frames of a run, from all of its sources."""

from __future__ import annotations

from collections.abc import Sequence

from training.selfsupervised.settings import SourceSettings
from training.sequences import opening
from training.sequences.calibration import Calibration
from training.sequences.camera_file import read_camera
from training.sequences.triplets import TripletSet


def open_triplets(sources: Sequence[SourceSettings]) -> TripletSet:
    """Every triplet of the sources, in their order.

    Raises:
        TrainingDataError: a source, calibration or split file that is missing or holds no usable frames.
    """
    sets = [_open(source) for source in sources]
    return TripletSet(
        tuple(triplet for part in sets for triplet in part.triplets),
        tuple(file for part in sets for file in part.skipped),
    )


def _open(source: SourceSettings) -> TripletSet:
    camera = None if source.calibration is None else read_camera(source.calibration)
    calibration = Calibration(camera, source.horizontal_fov_deg)
    return opening.open_triplets(source.kind, source.path, calibration, source.split)
