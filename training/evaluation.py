"""Measures a network, as it flies, on frames with a truth: each source of depth on each frame."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from training.evaluation_bands import BandedErrors, banded_errors
from training.evaluation_doubt import DoubtErrors, doubt_errors
from training.evaluation_frames import EvaluationFrame
from training.evaluation_knowledge import Knowledge, vehicle_knowledge
from training.evaluation_obstacles import SCAN_RANGE_M, ElementErrors, compare_scans
from training.evaluation_sheet import SheetRow
from training.evaluation_sky import SkyErrors, sky_errors
from training.evaluation_sources import PERFECT, Answer, Sources
from training.metrics import measurable, median_factor
from uavdepth.scan.scanner import ObstacleScanner


@dataclass(frozen=True)
class SourceErrors:
    """Errors of one source on one picture.

    Args:
        scaled: after the picture's median was made right, with the truth's help.
        metric: in metres as given; None for a source whose metres mean nothing.
        factor: truth over prediction, of the medians.
        unknown_share: pixels with a truth for which the source says nothing.
        doubt: sigma against errors; None for a source without sigma.
        sky: what is said of the sky; None for a picture without sky, or without metres.
        elements: nearest obstacles; None where they were not looked for.
    """

    scaled: BandedErrors
    metric: BandedErrors | None
    factor: float
    unknown_share: float
    doubt: DoubtErrors | None
    sky: SkyErrors | None
    elements: ElementErrors | None


@dataclass(frozen=True)
class FrameErrors:
    """What was measured on one frame.

    Args:
        group: kind of scene, or name of a sequence.
        name: which frame, for people.
        points: how many points there really were, by the number that was asked for.
        sources: errors of each source that had an answer; none for a frame without enough truth.
    """

    group: str
    name: str
    points: Mapping[int, int]
    sources: Mapping[str, SourceErrors]


@dataclass(frozen=True)
class MeasuredFrame:
    """Errors of a frame, and its row of the picture sheet."""

    errors: FrameErrors
    row: SheetRow


def measure_frame(sources: Sources, item: EvaluationFrame) -> MeasuredFrame:
    """Run every source on a rendered frame and compare it with the truth, nearest obstacles included."""
    frame = item.frame
    knowledge = vehicle_knowledge(item, sources.point_counts)
    scored = knowledge.without_points(frame.depth_m)
    given = sources.answers(frame.image_bgr, knowledge)
    answers = {label: answer.fitted(scored) for label, answer in given.items()}
    answers[PERFECT] = sources.perfect(frame.depth_m, frame.camera)
    scanner = ObstacleScanner(frame.camera, frame.mount, max_distance_m=SCAN_RANGE_M)
    truth = scanner.scan(frame.depth_m, frame.attitude, frame.height_m)
    found: dict[str, SourceErrors] = {}
    for label, answer in answers.items():
        elements = None
        if answer.metric:
            reported = scanner.scan(answer.depth_m, knowledge.attitude, knowledge.height_m)
            elements = compare_scans(truth, reported)
        compared = compare(scored, answer, elements)
        if compared is not None:
            found[label] = compared
    errors = FrameErrors(
        item.scene, f"{item.scene}:{item.seed} #{item.index}", point_counts(knowledge), found
    )
    shown = sources.richest.label
    return MeasuredFrame(errors, sheet_row(errors, frame.image_bgr, frame.depth_m, shown, answers[shown]))


def compare(
    truth_m: NDArray[np.float32], answer: Answer, elements: ElementErrors | None = None
) -> SourceErrors | None:
    """Errors of one answer; None for a picture with too little truth or an answer without a median.

    Args:
        truth_m: (H, W) float32 z-depth in metres, NaN where not scored, +inf in the sky.
        answer: of a source.
        elements: its nearest obstacles, where they were looked for.
    """
    factor = median_factor(truth_m, answer.depth_m)
    if factor is None:
        return None
    scaled = banded_errors(truth_m, answer.depth_m, factor)
    metric = banded_errors(truth_m, answer.depth_m) if answer.metric else None
    if scaled is None:
        return None
    doubt = None
    if answer.relative_sigma is not None:
        depth = answer.depth_m if answer.metric else answer.depth_m * np.float32(factor)
        doubt = doubt_errors(truth_m, depth, answer.relative_sigma)
    there = measurable(truth_m, np.zeros_like(truth_m))
    unknown = float(np.mean(np.isnan(answer.depth_m[there])))
    sky = sky_errors(truth_m, answer.depth_m, answer.relative_sigma) if answer.metric else None
    return SourceErrors(scaled, metric, factor, unknown, doubt, sky, elements)


def point_counts(knowledge: Knowledge) -> dict[int, int]:
    """How many points there are, by the number that was asked for."""
    return {count: len(points) for count, points in knowledge.points.items()}


def sheet_row(
    errors: FrameErrors,
    image_bgr: NDArray[np.uint8],
    truth_m: NDArray[np.float32],
    label: str,
    answer: Answer,
) -> SheetRow:
    """Row of a measured frame: the answer of one source as given, or at the truth's median without metres."""
    caption, depth_m = errors.name, answer.depth_m
    found = errors.sources.get(label)
    if found is not None and found.metric is not None:
        caption += (
            f"   {label}: Abs Rel {found.metric.overall.abs_rel:.3f} as given (drawn), "
            f"{found.scaled.overall.abs_rel:.3f} median-scaled"
        )
    elif found is not None:
        caption += f"   {label}: Abs Rel {found.scaled.overall.abs_rel:.3f} median-scaled (drawn)"
        depth_m = depth_m * np.float32(found.factor)
    return SheetRow(caption, image_bgr, truth_m, depth_m, answer.relative_sigma)
