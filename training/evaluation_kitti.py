"""Measures a network, zero-shot, on real pictures: KITTI's, with the depth of a LiDAR."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from training.errors import EvaluationError
from training.evaluation import FrameErrors, MeasuredFrame, compare, point_counts, sheet_row
from training.evaluation_knowledge import Knowledge, frame_key
from training.evaluation_sources import Sources
from training.metrics import DEPTH_CAP_M, SMALLEST_DEPTH_M
from training.sequences.garg_crop import garg_mask
from training.sequences.kitti_raw import KittiDrive
from uavdepth.attitude import Attitude
from uavdepth.camera import CameraModel, CameraMount
from uavdepth.model.hints import PointHints

CAMERA_HEIGHT_M = 1.65
"""Of the colour cameras above the road (Geiger et al. 2013, figure 3); the road is taken as level."""

POINT_SIGMA = 0.05
"""Standard deviation of the relative error that is added to the LiDAR's depth to make point hints of it."""

LEFT_CAMERA = "image_02"
"""Both cameras see the same ten metres of road: two pictures of one moment are not two measurements."""

FEW_PICTURES = 100


@dataclass(frozen=True)
class KittiFrame:
    """One picture of a drive that has a LiDAR turn."""

    drive: KittiDrive
    index: int

    @property
    def name(self) -> str:
        """Its drive and number."""
        return f"{self.drive.name} #{self.index}"


def kitti_frames(drives: Sequence[KittiDrive], every: int = 1) -> list[KittiFrame]:
    """Pictures of the left colour camera of each drive, one of every so many.

    Raises:
        EvaluationError: no pictures, or `every` below 1.
    """
    if every < 1:
        raise EvaluationError(f"every is {every}: 1 or more is needed")
    left = [drive for drive in drives if drive.name.endswith(LEFT_CAMERA)]
    frames = [KittiFrame(drive, index) for drive in left for index in range(0, len(drive), every)]
    if not frames:
        raise EvaluationError(f"there are no pictures of {LEFT_CAMERA} among {len(drives)} sequences")
    return frames


def measure_kitti_frame(sources: Sources, frame: KittiFrame) -> MeasuredFrame:
    """Run every source on one picture and compare it with the LiDAR inside the Garg crop.

    Point hints are LiDAR points anywhere in the picture, with errors; they are not scored.

    Raises:
        BrokenFrameError: a picture or LiDAR file that is missing, unreadable or of another size.
        EvaluationError: a frame without LiDAR.
    """
    truth = frame.drive.truth_m(frame.index)
    if truth is None:
        raise EvaluationError(f"{frame.name} has no LiDAR points or no calibration of the LiDAR")
    image = frame.drive.image_bgr(frame.index)
    knowledge = road_knowledge(frame, truth, sources.point_counts)
    scored = np.where(garg_mask(*truth.shape), knowledge.without_points(truth), np.float32(np.nan))
    given = sources.answers(image, knowledge)
    answers = {label: answer.fitted(scored) for label, answer in given.items()}
    compared = {label: compare(scored, answer) for label, answer in answers.items()}
    found = {label: errors for label, errors in compared.items() if errors is not None}
    errors = FrameErrors(frame.drive.name, frame.name, point_counts(knowledge), found)
    shown = sources.richest.label
    return MeasuredFrame(errors, sheet_row(errors, image, truth, shown, answers[shown]))


def road_knowledge(frame: KittiFrame, truth_m: NDArray[np.float32], counts: Sequence[int]) -> Knowledge:
    """A level camera above a level road, and noisy LiDAR points; the same frame gives the same ones.

    Args:
        frame: which.
        truth_m: (H, W) LiDAR depth, NaN between the points.
        counts: how many points for each mode.
    """
    points = {}
    for count in counts:
        rng = np.random.default_rng(
            [*frame_key(frame.drive.name, frame.drive.first_number, frame.index), count]
        )
        points[count] = lidar_points(rng, truth_m, count)
    camera: CameraModel = frame.drive.camera
    return Knowledge(camera, CameraMount(), Attitude(0.0, 0.0, 0.0), CAMERA_HEIGHT_M, points)


def lidar_points(rng: np.random.Generator, truth_m: NDArray[np.float32], count: int) -> PointHints:
    """At most `count` random points of a sparse truth, each wrong by `POINT_SIGMA` of its depth."""
    with np.errstate(invalid="ignore"):
        row, column = np.nonzero((truth_m >= SMALLEST_DEPTH_M) & (truth_m < DEPTH_CAP_M))
    chosen = rng.choice(len(row), size=min(count, len(row)), replace=False)
    row, column = row[chosen], column[chosen]
    noise = np.exp(POINT_SIGMA * rng.standard_normal(len(chosen)))
    return PointHints(
        np.stack([column, row], axis=1).astype(np.float32),
        (truth_m[row, column] * noise).astype(np.float32),
        np.full(len(chosen), POINT_SIGMA, np.float32),
    )


def caution(pictures: int) -> str:
    """What a reader of so many pictures' errors must know."""
    if pictures >= FEW_PICTURES:
        return "KITTI is for research only (CC BY-NC-SA 3.0); no weights are selected on it."
    return (
        f"{pictures} pictures decide nothing: networks are selected on rendered validation worlds, never on "
        "these. KITTI is for research only (CC BY-NC-SA 3.0)."
    )


def sequence_names(frames: Sequence[KittiFrame]) -> Iterator[str]:
    """Names of the drives, each once."""
    yield from dict.fromkeys(frame.drive.name for frame in frames)
