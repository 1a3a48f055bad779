"""Calibration of a network's sigma: one factor, from worlds that are kept for choices."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from pydantic import JsonValue

from training.data.seed_split import SeedSplit
from training.errors import EvaluationError
from training.evaluation_doubt import NOMINAL_COVERAGE, SIGMAS, doubt_errors
from training.evaluation_frames import EvaluationPlan
from training.evaluation_knowledge import HintMode, hint_modes, vehicle_knowledge
from uavdepth.model.depth_model import DepthModel

_NOMINAL = NOMINAL_COVERAGE[SIGMAS.index(1.0)]


@dataclass(frozen=True)
class DoubtCalibration:
    """What was found.

    Args:
        factor: sigma times it covers 68.3 % of the pixels.
        coverage: share of pixels within one sigma before, by the label of the hints.
        frames: pictures that told it.
        data: where they are from.
    """

    factor: float
    coverage: dict[str, float]
    frames: int
    data: str

    def as_json(self) -> dict[str, JsonValue]:
        """For the network's card."""
        return {
            "factor": round(self.factor, 4),
            "within_one_sigma_before": {label: round(share, 4) for label, share in self.coverage.items()},
            "frames": self.frames,
            "data": self.data,
        }


def calibrate_doubt(
    model: DepthModel, plan: EvaluationPlan, point_counts: Sequence[int] = (100,)
) -> DoubtCalibration:
    """Find the factor that makes a network's sigma one standard deviation on worlds it never saw.

    A network is surer of what it learnt by than of what it meets. Every picture and every set of hints
    counts alike.

    Args:
        model: the network, which must say its sigma.
        plan: worlds of validation seeds: those of tests are for the final measurement alone.
        point_counts: sets of points that are asked about beside no hints and the ground alone.

    Raises:
        EvaluationError: seeds of tests, or no picture that tells anything.
    """
    if plan.split is not SeedSplit.VALIDATION:
        raise EvaluationError(
            f"seed {plan.seeds[0]} is for tests: sigma is calibrated on validation seeds, "
            f"{SeedSplit.VALIDATION.value.start} to {SeedSplit.VALIDATION.value.stop - 1}"
        )
    modes = hint_modes(model.card.hints, point_counts)
    ratios: dict[HintMode, list[np.ndarray]] = {mode: [] for mode in modes}
    frames = 0
    for item in plan.frames():
        knowledge = vehicle_knowledge(item, point_counts)
        scored = knowledge.without_points(item.frame.depth_m)
        frames += 1
        for mode in modes:
            depth = model.infer(item.frame.image_bgr, item.frame.camera, knowledge.hints(mode))
            if depth.relative_sigma is None:
                raise EvaluationError(f"{model.card.name} says no sigma: there is nothing to calibrate")
            errors = doubt_errors(scored, depth.depth_m, depth.relative_sigma)
            if errors is not None:
                ratios[mode].append(errors.sample_ratio)
    together = [np.concatenate(found) for found in ratios.values() if found]
    if not together:
        raise EvaluationError("no picture shows enough known depth to calibrate sigma with")
    return DoubtCalibration(
        factor=float(np.quantile(np.concatenate(together), _NOMINAL)),
        coverage={
            mode.label: float(np.mean(np.concatenate(found) < 1.0)) for mode, found in ratios.items() if found
        },
        frames=frames,
        data=f"validation seeds {plan.seeds[0]} to {plan.seeds[-1]} of {', '.join(plan.scenes)}",
    )
