"""Measures a network, as it flies, on rendered frames with exact depth."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from training.baselines import constant_depth, flat_ground_depth
from training.data.frame_store import NewFrame
from training.evaluation_frames import EvaluationFrame
from training.evaluation_sheet import SheetRow
from training.metrics import DepthMetrics, depth_metrics, median_factor
from uavdepth.depth_model import DepthModel
from uavdepth.ground_scale import GroundScaler

PLAUSIBLE_FACTORS = (0.4, 2.5)
"""Corrections by the ground that are believed of a metric network, as in flight."""


class Method(StrEnum):
    """Where depth comes from."""

    NETWORK = "network"
    GROUND_SCALED = "network, scaled by the ground"
    NETWORK_THERE = "network, on those frames"
    CONSTANT = "constant depth"
    FLAT_GROUND = "flat ground"


@dataclass(frozen=True)
class MethodErrors:
    """Errors of one method on one picture.

    Args:
        scaled: after the picture's median was made right, with the truth's help.
        unscaled: in metres as given.
    """

    scaled: DepthMetrics
    unscaled: DepthMetrics


@dataclass(frozen=True)
class FrameErrors:
    """What was measured on one frame.

    Args:
        scene, seed, index: which frame.
        methods: errors of each method that had an answer.
        median_factor: truth over network, of the medians; None for a picture without enough truth.
        ground_factor: the factor found from the ground, or None.
        within_sigma: share of pixels whose error, at the right scale, is below one sigma; None if unknown.
    """

    scene: str
    seed: int
    index: int
    methods: Mapping[Method, MethodErrors]
    median_factor: float | None
    ground_factor: float | None
    within_sigma: float | None


@dataclass(frozen=True)
class MeasuredFrame:
    """Errors of a frame and the network's depth, for the picture sheet."""

    errors: FrameErrors
    predicted_m: NDArray[np.float32]


def measure_frame(model: DepthModel, item: EvaluationFrame) -> MeasuredFrame:
    """Run the network on one frame and compare it, and the two baselines, with the truth."""
    frame = item.frame
    answer = model.infer(frame.image_bgr, frame.camera)
    truth, predicted = frame.depth_m, answer.depth_m
    factor = median_factor(truth, predicted)
    plausible = PLAUSIBLE_FACTORS if model.card.metric else None
    scaler = GroundScaler(frame.camera, frame.mount, plausible)
    ground = scaler.estimate(predicted, frame.attitude, frame.height_m)
    answers = {Method.NETWORK: predicted, Method.CONSTANT: constant_depth(frame.camera)}
    if ground is not None:
        answers[Method.GROUND_SCALED] = predicted * np.float32(ground.factor)
    if frame.height_m is not None:
        answers[Method.FLAT_GROUND] = flat_ground_depth(
            frame.camera, frame.mount, frame.attitude, frame.height_m
        )
    found = {method: _errors(truth, depth) for method, depth in answers.items()}
    methods = {method: errors for method, errors in found.items() if errors is not None}
    if Method.GROUND_SCALED in methods:
        # What the ground adds shows only against the same frames without it.
        methods[Method.NETWORK_THERE] = methods[Method.NETWORK]
    errors = FrameErrors(
        item.scene,
        item.seed,
        item.index,
        methods,
        factor,
        None if ground is None else ground.factor,
        _within_sigma(frame, predicted, answer.relative_sigma, factor),
    )
    return MeasuredFrame(errors, predicted)


def sheet_row(item: EvaluationFrame, measured: MeasuredFrame) -> SheetRow:
    """Row of a measured frame; the prediction is drawn at the truth's median, as the caption says."""
    errors = measured.errors
    factor, network = errors.median_factor, errors.methods.get(Method.NETWORK)
    caption = f"{item.scene}:{item.seed} #{item.index}"
    if factor is not None and network is not None:
        ground = "-" if errors.ground_factor is None else f"{errors.ground_factor:.2f}"
        caption += (
            f"  Abs Rel {network.scaled.abs_rel:.3f} scaled, {network.unscaled.abs_rel:.3f} as given; "
            f"factor {factor:.2f}, from the ground {ground}"
        )
    shown = measured.predicted_m * np.float32(1.0 if factor is None else factor)
    return SheetRow(caption, item.frame.image_bgr, item.frame.depth_m, shown)


@dataclass(frozen=True)
class MethodSummary:
    """Mean errors of one method.

    Args:
        method: which.
        frames: pictures on which it had an answer.
        scaled, unscaled: as in `MethodErrors`; None for no pictures.
    """

    method: Method
    frames: int
    scaled: DepthMetrics | None
    unscaled: DepthMetrics | None


def summarise(errors: Sequence[FrameErrors]) -> list[MethodSummary]:
    """Mean errors of each method, each picture counting alike."""
    summaries = []
    for method in Method:
        found = [item.methods[method] for item in errors if method in item.methods]
        scaled = DepthMetrics.mean([item.scaled for item in found])
        unscaled = DepthMetrics.mean([item.unscaled for item in found])
        summaries.append(MethodSummary(method, len(found), scaled, unscaled))
    return summaries


def _errors(truth: NDArray[np.float32], depth: NDArray[np.float32]) -> MethodErrors | None:
    factor = median_factor(truth, depth)
    if factor is None:
        return None
    scaled, unscaled = depth_metrics(truth, depth, factor), depth_metrics(truth, depth)
    return None if scaled is None or unscaled is None else MethodErrors(scaled, unscaled)


def _within_sigma(
    frame: NewFrame,
    predicted: NDArray[np.float32],
    sigma: NDArray[np.float32] | None,
    factor: float | None,
) -> float | None:
    """68 % of pixels for an honest Gaussian sigma; 76 % for the Laplace scale that the loss teaches."""
    if sigma is None or factor is None:
        return None
    valid = np.isfinite(frame.depth_m) & np.isfinite(predicted) & np.isfinite(sigma)
    error = np.abs(np.log(frame.depth_m[valid] / (predicted[valid] * np.float32(factor))))
    return float(np.mean(error < sigma[valid]))
