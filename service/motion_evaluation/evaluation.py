"""One journey through the whole chain: points, network with live hints, scale estimators."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from service.motion_evaluation.depth_errors import abs_rel, log_scale
from service.motion_evaluation.journey import Journey, Moment
from service.motion_evaluation.point_errors import PointErrors
from service.motion_evaluation.scale_errors import SETTLED_S, SHORT_DRIVE_S, ScaleErrors
from service.motion_evaluation.unitless import UNIT_M, UnitlessTruth
from uavdepth.depth.depth_map import DepthMap
from uavdepth.model.depth_model import DepthModel
from uavdepth.model.hints import Hints, PointHints
from uavdepth.motion.motion_points import MotionPoints
from uavdepth.motion.vehicle_motion import VehicleMotion
from uavdepth.scale.estimator import ScaleEstimator, apply

SourceSet = Literal["points", "ground", "both"]
SOURCE_SETS: tuple[SourceSet, ...] = ("both", "points", "ground")
FLOWN = ("flight", "recorded")
"""Groups of journeys with exact depth and a rangefinder."""

DepthName = Literal["network", "truth relative", "truth affine"]

_LEAST_POINTS = 8
"""A picture with fewer points counts as one without live hints."""


@dataclass
class Errors:
    """What was measured along one or several journeys.

    Args:
        points: of triangulated points.
        hinted: Abs Rel of the network with live hints, picture by picture, where it had points.
        unhinted: the same without any hint.
        held_out: where nothing else is known: Abs Rel of the network that got every second point, at the
            others, picture by picture.
        scales: of the estimator, by depth and sources; where nothing else is known against held-out points.
    """

    points: PointErrors = field(default_factory=PointErrors)
    hinted: list[float] = field(default_factory=list)
    unhinted: list[float] = field(default_factory=list)
    held_out: list[float] = field(default_factory=list)
    scales: dict[tuple[DepthName, SourceSet], ScaleErrors] = field(default_factory=dict)

    def join(self, other: Errors) -> None:
        """Add another's."""
        self.points.join(other.points)
        self.hinted += other.hinted
        self.unhinted += other.unhinted
        self.held_out += other.held_out
        for key, errors in other.scales.items():
            self.scales.setdefault(key, ScaleErrors(errors.settled_s)).join(errors)


class _Track:
    """A depth source and the estimators that bring it to metres."""

    def __init__(self, name: DepthName, journey: Journey, sets: Iterable[SourceSet]) -> None:
        kind: Literal["relative", "affine"] = "affine" if name == "truth affine" else "relative"
        self.name = name
        self._estimators = {each: ScaleEstimator(journey.camera, journey.mount, kind) for each in sets}
        self.errors: dict[SourceSet, ScaleErrors] = {
            each: ScaleErrors(SETTLED_S if journey.group in FLOWN else SHORT_DRIVE_S)
            for each in self._estimators
        }

    def add(self, depth: DepthMap, moment: Moment, points: PointHints, passed_s: float) -> None:
        told = points if moment.truth_m is not None else _every_second(points, 0)
        for each, estimator in self._estimators.items():
            ground = None if each == "points" else moment.ground
            estimate = estimator.update(depth, ground, None if each == "ground" else told, moment.at_ns)
            log_error, wrong = math.nan, math.nan
            if estimate is not None and moment.truth_m is None:
                metres, others = apply(estimate, depth).depth_m, _every_second(points, 1)
                log_error, wrong = _log_scale_at(metres, others), _at_points(metres, others)
            elif estimate is not None and moment.truth_m is not None:
                metres = apply(estimate, depth).depth_m
                log_error, wrong = log_scale(metres, moment.truth_m), abs_rel(metres, moment.truth_m)
            self.errors[each].add(estimate, log_error, wrong, moment.speed_mps, passed_s)


def evaluate_journey(journey: Journey, model: DepthModel | None) -> Errors:
    """Fly one journey.

    Args:
        journey: the pictures; those without exact depth everywhere are measured with the network alone.
        model: the network, or None to leave it out.
    """
    motion, tracker = VehicleMotion(), MotionPoints(journey.camera, journey.mount)
    errors, tracks = Errors(), dict[str, _Track]()
    unitless = {each: UnitlessTruth(each) for each in ("relative", "affine")}
    for moment, passed_s in _with_steps(journey.moments()):
        _hear(motion, moment)
        points = tracker.update(moment.image_bgr, moment.at_ns, motion)
        if moment.truth_m is not None:
            errors.points.add(points, moment.truth_m)
        depths = dict[DepthName, DepthMap]()
        if model is not None:
            depths["network"] = _network(model, journey, moment, points, errors)
        if moment.truth_m is not None and not np.isnan(moment.truth_m).any():
            for kind, maker in unitless.items():
                name: DepthName = "truth relative" if kind == "relative" else "truth affine"
                depths[name] = maker.of(moment.truth_m, passed_s)
        sets: tuple[SourceSet, ...] = SOURCE_SETS if journey.group in FLOWN else ("points",)
        for each, depth in depths.items():
            if each not in tracks:
                tracks[each] = _Track(each, journey, sets)
            tracks[each].add(depth, moment, points, passed_s)
    for track in tracks.values():
        for sources, scale_errors in track.errors.items():
            scale_errors.close()
            errors.scales[(track.name, sources)] = scale_errors
    return errors


def _with_steps(moments: Iterator[Moment]) -> Iterator[tuple[Moment, float]]:
    before_ns = None
    for moment in moments:
        yield moment, 0.0 if before_ns is None else (moment.at_ns - before_ns) * 1e-9
        before_ns = moment.at_ns


def _hear(motion: VehicleMotion, moment: Moment) -> None:
    for said in moment.said:
        if said.attitude is not None:
            motion.add_attitude(said.at_ns, said.attitude)
        if said.position_ned_m is not None and said.velocity_ned_mps is not None:
            motion.add_position(said.at_ns, said.position_ned_m, said.velocity_ned_mps)


def _network(
    model: DepthModel, journey: Journey, moment: Moment, points: PointHints, errors: Errors
) -> DepthMap:
    """The network's depth without hints and without its unit; its errors with them go into `errors`."""
    alone = model.infer(moment.image_bgr, journey.camera)
    hinted = bool(model.card.hints) and len(points) >= _LEAST_POINTS
    if moment.truth_m is not None:
        if model.card.metric:
            _put(errors.unhinted, abs_rel(alone.depth_m, moment.truth_m))
        if hinted:
            told = model.infer(moment.image_bgr, journey.camera, Hints(moment.ground, points))
            _put(errors.hinted, abs_rel(told.depth_m, moment.truth_m))
    elif hinted:
        told = model.infer(moment.image_bgr, journey.camera, Hints(moment.ground, _every_second(points, 0)))
        _put(errors.held_out, _at_points(told.depth_m, _every_second(points, 1)))
    if alone.affine_inverse_depth is not None:
        return alone
    return DepthMap(alone.depth_m / np.float32(UNIT_M), alone.relative_sigma)


def _every_second(points: PointHints, first: int) -> PointHints:
    return PointHints(points.pixels[first::2], points.depth_m[first::2], points.relative_sigma[first::2])


def _log_scale_at(depth_m: NDArray[np.float32], points: PointHints) -> float:
    """Log of the median of depth over the points'."""
    if len(points) < _LEAST_POINTS:
        return math.nan
    column, row = np.rint(points.pixels).astype(int).T
    found = depth_m[row, column]
    known = np.isfinite(found) & (found > 0)
    return float(np.median(np.log(found[known] / points.depth_m[known]))) if known.any() else math.nan


def _at_points(depth_m: NDArray[np.float32], points: PointHints) -> float:
    """Mean Abs Rel of depth at points."""
    column, row = np.rint(points.pixels).astype(int).T
    found = depth_m[row, column]
    known = np.isfinite(found)
    return (
        float(np.mean(np.abs(found - points.depth_m)[known] / points.depth_m[known]))
        if known.any()
        else math.nan
    )


def _put(numbers: list[float], number: float) -> None:
    if math.isfinite(number):
        numbers.append(number)
