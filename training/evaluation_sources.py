"""Where depth comes from when it is measured: the network with each of its hints, and what costs nothing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from training.baselines import constant_depth, flat_ground_depth, nearest_point_depth
from training.evaluation_affine import fit_to_points, fit_to_truth
from training.evaluation_knowledge import HintMode, Knowledge, hint_modes, points_ratio
from uavdepth.camera import CameraModel
from uavdepth.model.depth_model import DepthModel
from uavdepth.model.hints import PointHints
from uavdepth.scale.ground_scale import GroundScaler

CONSTANT = "constant depth"
FLAT_GROUND = "flat ground"
_RESCALED = "none, "
GROUND_SCALED = _RESCALED + "scaled by the ground"
THERE = _RESCALED + "on those frames"
"""What the ground's scale adds shows only against the same frames without it."""

PERFECT = "a perfect network"
"""The truth at the network's pixels: in scans it shows what resolution and the vehicle's errors cost."""

PLAUSIBLE_FACTORS = (0.4, 2.5)
"""Corrections by the ground that are believed of a metric network, as in flight."""


def points_scaled(count: int) -> str:
    """Label of a network without point hints whose scale is set by points."""
    return f"{_RESCALED}scaled by {count} points"


def is_rescaled(label: str) -> bool:
    """Whether a source is the network without hints at another scale, or on some of the frames."""
    return label.startswith(_RESCALED)


def nearest_of(count: int) -> str:
    """Label of the answer that every pixel has the depth of the nearest point."""
    return f"nearest of {count} points"


@dataclass(frozen=True)
class Answer:
    """What a source says about one picture.

    Args:
        depth_m: (H, W) float32 z-depth in metres, NaN where unknown.
        relative_sigma: (H, W) float32 its doubt, or None.
        metric: whether its metres mean anything.
        affine_inverse_depth: (H, W) float32 where scale and shift are still to be found, as in `DepthMap`.
    """

    depth_m: NDArray[np.float32]
    relative_sigma: NDArray[np.float32] | None = None
    metric: bool = True
    affine_inverse_depth: NDArray[np.float32] | None = None

    def fitted(self, truth_m: NDArray[np.float32]) -> Answer:
        """The same, with scale and shift fitted to the truth where they are still to be found."""
        if self.affine_inverse_depth is None:
            return self
        depth_m = fit_to_truth(self.affine_inverse_depth, truth_m)
        return Answer(self.depth_m if depth_m is None else depth_m, metric=False)


class Sources:
    """Every source that a network is measured by and beside.

    Args:
        model: the network.
        point_counts: how many points it is given, one mode for each.

    Raises:
        EvaluationError: an impossible count of points.
    """

    def __init__(self, model: DepthModel, point_counts: Sequence[int]) -> None:
        self.model = model
        self.point_counts = tuple(point_counts)
        self.takes = frozenset(model.card.hints)
        self.modes = hint_modes(self.takes, self.point_counts)

    @property
    def networks(self) -> tuple[str, ...]:
        """Names of the sources that are the network, with each of its hints or scaled."""
        names = [mode.label for mode in self.modes]
        if "ground" not in self.takes:
            names += [GROUND_SCALED, THERE]
        if "points" not in self.takes:
            names += [points_scaled(count) for count in self.point_counts]
        return tuple(names)

    @property
    def labels(self) -> tuple[str, ...]:
        """Names of all sources in the order of the tables: the network first."""
        nearest = (nearest_of(count) for count in self.point_counts)
        return (*self.networks, CONSTANT, FLAT_GROUND, *nearest, PERFECT)

    @property
    def richest(self) -> HintMode:
        """The mode with most hints."""
        return self.modes[-1]

    def answers(self, image_bgr: NDArray[np.uint8], knowledge: Knowledge) -> Mapping[str, Answer]:
        """What each source says about a picture; one without the knowledge that it needs says nothing."""
        answers = {mode.label: self._infer(image_bgr, knowledge, mode) for mode in self.modes}
        answers.update(self._scaled(answers[HintMode().label], knowledge))
        answers[CONSTANT] = Answer(constant_depth(knowledge.camera))
        if knowledge.height_m is not None:
            answers[FLAT_GROUND] = Answer(
                flat_ground_depth(knowledge.camera, knowledge.mount, knowledge.attitude, knowledge.height_m)
            )
        for count, points in knowledge.points.items():
            if len(points):
                answers[nearest_of(count)] = Answer(nearest_point_depth(knowledge.camera, points))
        return answers

    def perfect(self, truth_m: NDArray[np.float32], camera: CameraModel) -> Answer:
        """The (H, W) truth as a network that is always right would say it: at its own size, brought back."""
        small = cv2.resize(truth_m, self.model.card.input_size(camera), interpolation=cv2.INTER_NEAREST_EXACT)
        back = cv2.resize(small, (camera.width, camera.height), interpolation=cv2.INTER_NEAREST_EXACT)
        return Answer(np.asarray(back, np.float32))

    def _infer(self, image_bgr: NDArray[np.uint8], knowledge: Knowledge, mode: HintMode) -> Answer:
        found = self.model.infer(image_bgr, knowledge.camera, knowledge.hints(mode))
        return Answer(found.depth_m, found.relative_sigma, self.model.card.metric, found.affine_inverse_depth)

    def _scaled(self, plain: Answer, knowledge: Knowledge) -> dict[str, Answer]:
        """What is done for a network that takes no hints: one factor from the ground, or from points."""
        scaled: dict[str, Answer] = {}
        if "ground" not in self.takes:
            plausible = PLAUSIBLE_FACTORS if self.model.card.metric else None
            scaler = GroundScaler(knowledge.camera, knowledge.mount, plausible)
            ground = scaler.estimate(plain.depth_m, knowledge.attitude, knowledge.height_m)
            if ground is not None:
                scaled[GROUND_SCALED] = _times(plain, ground.factor)
                scaled[THERE] = plain
        if "points" not in self.takes:
            for count, points in knowledge.points.items():
                answer = _scaled_by_points(plain, points, knowledge.camera)
                if answer is not None:
                    scaled[points_scaled(count)] = answer
        return scaled


def _scaled_by_points(plain: Answer, points: PointHints, camera: CameraModel) -> Answer | None:
    if plain.affine_inverse_depth is not None:
        depth_m = fit_to_points(plain.affine_inverse_depth, points, camera)
        return None if depth_m is None else Answer(depth_m)
    factor = points_ratio(points, camera, plain.depth_m)
    return None if factor is None else _times(plain, factor)


def _times(answer: Answer, factor: float) -> Answer:
    return Answer(answer.depth_m * np.float32(factor), answer.relative_sigma)
