"""A network's 8-bit file: convolutions that multiply whole numbers, and what that costs in depth.

Weights get a scale for each output channel, activations one for each map, from the smallest and the largest
value on rendered worlds (static quantisation as ONNX Runtime writes it). The first layers and the last ones
stay in floating point: there a step of an 8-bit number is a step of the answer.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import onnx
from numpy.typing import NDArray
from onnxruntime.quantization import CalibrationDataReader, QuantFormat, QuantType, quantize_static
from pydantic import JsonValue

from training.data.seed_split import SeedSplit
from training.errors import EvaluationError, ExportError
from training.evaluation_frames import EvaluationFrame, EvaluationPlan
from training.evaluation_knowledge import hint_modes, vehicle_knowledge
from training.evaluation_sheet import spread_evenly
from training.half_weights import restore_single
from training.metrics import depth_metrics, median_factor
from training.onnx_file import strip_traces, write_checked
from uavdepth.model.depth_model import DepthModel
from uavdepth.model.hints import Hints
from uavdepth.model.inference import open_session
from uavdepth.model.int8_file import SOURCE_METADATA_KEY, digest

KEPT_IN_FLOAT = (
    "encoder.stem.",
    "encoder.stages.0.",
    "encoder.stages.1.",
    "encoder.stages.2.",
    ".laterals.",
    ".hints.",
    ".context.",
    ".depth_head.",
    ".correction.",
)
"""Parts of names of weights that stay in floating point.

With every convolution in 8 bits Abs Rel of a flight network grew by 12.6 %; with these left out, that of the
shipped ones grows by 1.3 % at most (worlds of seeds 902 and 903, 23 November 2026).
"""

MOST_LOST = 0.02
"""Share by which Abs Rel may grow with any set of hints."""

_CALIBRATION_INPUTS = 48
"""Pictures that the ranges are taken from: each is a run of the network with every map kept."""

Inputs = dict[str, np.ndarray]


@dataclass(frozen=True)
class QuantizationCost:
    """Abs Rel by the label of the hints, in metres where the network knows them, else median-scaled."""

    float_abs_rel: Mapping[str, float]
    int8_abs_rel: Mapping[str, float]

    @property
    def lost(self) -> dict[str, float]:
        """Share by which Abs Rel grew, by label."""
        return {
            label: self.int8_abs_rel[label] / before - 1.0 for label, before in self.float_abs_rel.items()
        }

    def as_json(self) -> dict[str, JsonValue]:
        """For the file's card."""
        return {
            label: {"float_abs_rel": round(before, 4), "int8_abs_rel": round(self.int8_abs_rel[label], 4)}
            for label, before in self.float_abs_rel.items()
        }


def quantize(
    source: Path,
    output: Path,
    ranges: EvaluationPlan,
    judges: EvaluationPlan,
    kept: Sequence[str] = KEPT_IN_FLOAT,
    point_counts: Sequence[int] = (100,),
) -> QuantizationCost:
    """Write a network's 8-bit file.

    Args:
        source: the network, with its card in the file or beside it.
        output: the file to write, named by `uavdepth.model.int8_file.int8_beside` to be found.
        ranges: worlds of validation seeds that the ranges of activations are taken from.
        judges: other worlds of validation seeds, which say what it costs.
        kept: parts of names of weights whose convolutions stay in floating point.
        point_counts: sets of points that are told beside no hints and the ground alone.

    Raises:
        EvaluationError: worlds of tests, worlds in both plans, or none that tells anything.
        ExportError: a network without a convolution to convert, one whose depth has an unknown shift, or one
            that loses more than `MOST_LOST`.
    """
    _check_plans(ranges, judges)
    model = DepthModel.load(source, "cpu", precision="float")
    if model.card.output == "affine_inverse_depth":
        raise ExportError(f"{source}: depth up to scale and shift has no Abs Rel to judge 8 bits by")
    properties = {SOURCE_METADATA_KEY: digest(source)}
    with TemporaryDirectory() as folder:
        trial = Path(folder) / "int8.onnx"
        converted = _converted(source, kept, _inputs(model, source, ranges, point_counts), Path(folder))
        write_checked(converted, model.card, trial, lambda _file: None, properties)
        cost = _cost(model, DepthModel.load(trial, "cpu"), judges, point_counts)
    _check_cost(cost)
    measured = {**model.card.measured, "int8_against_float": cost.as_json()}
    created = datetime.now(UTC).isoformat(timespec="seconds")
    card = model.card.model_copy(update={"measured": measured, "created": created})
    write_checked(converted, card, output, lambda _file: None, properties)
    return cost


def _check_plans(ranges: EvaluationPlan, judges: EvaluationPlan) -> None:
    for plan in (ranges, judges):
        if plan.split is not SeedSplit.VALIDATION:
            allowed = SeedSplit.VALIDATION.value
            raise EvaluationError(
                f"seed {plan.seeds[0]} is for tests: a network is quantised on validation seeds, "
                f"{allowed.start} to {allowed.stop - 1}"
            )
    both = set(ranges.seeds) & set(judges.seeds)
    if both:
        raise EvaluationError(f"seed {min(both)} gives ranges and judges them: take other seeds for the one")


def _converted(source: Path, kept: Sequence[str], inputs: Sequence[Inputs], folder: Path) -> onnx.ModelProto:
    """The graph with quantised convolutions."""
    graph = onnx.load(str(source))
    restore_single(graph)
    excluded = _excluded_convolutions(graph, kept)
    single, whole = folder / "single.onnx", folder / "whole.onnx"
    onnx.save(graph, str(single))
    with _quiet_quantizer():
        quantize_static(
            str(single),
            str(whole),
            _Reader(inputs),
            quant_format=QuantFormat.QDQ,
            op_types_to_quantize=["Conv"],
            nodes_to_exclude=excluded,
            per_channel=True,
            activation_type=QuantType.QUInt8,
            weight_type=QuantType.QInt8,
        )
    converted = onnx.load(str(whole))
    strip_traces(converted)
    return converted


def _excluded_convolutions(graph: onnx.ModelProto, kept: Sequence[str]) -> list[str]:
    """Names of the convolutions that stay in floating point; every convolution has a name afterwards."""
    convolutions = [node for node in graph.graph.node if node.op_type == "Conv"]
    for number, node in enumerate(convolutions):
        node.name = node.name or f"convolution_{number}"
    excluded = [node.name for node in convolutions if any(part in node.input[1] for part in kept)]
    if len(excluded) == len(convolutions):
        raise ExportError(
            f"none of the network's {len(convolutions)} convolutions can be converted: "
            f"{len(excluded)} are kept in floating point"
        )
    return excluded


class _Reader(CalibrationDataReader):  # type: ignore[misc]
    """Hands inputs to ONNX Runtime, one after the other."""

    def __init__(self, inputs: Sequence[Inputs]) -> None:
        self._rest = iter(inputs)

    def get_next(self) -> Inputs | None:
        return next(self._rest, None)


class _InputRecorder:
    """A session that keeps what it is given."""

    def __init__(self, session: Any) -> None:
        self._session = session
        self.get_inputs = session.get_inputs
        self.inputs: list[Inputs] = []

    def run(self, names: Sequence[str], inputs: Inputs) -> Any:
        self.inputs.append(inputs)
        return self._session.run(names, inputs)


def _inputs(
    model: DepthModel, source: Path, plan: EvaluationPlan, point_counts: Sequence[int]
) -> list[Inputs]:
    """What the network is given for some pictures of the worlds, with every set of hints in turn."""
    session = open_session(source, "cpu", None, "float")
    recorder = _InputRecorder(session.session)
    recording = DepthModel(replace(session, session=recorder), model.card, model.source)
    modes = hint_modes(model.card.hints, point_counts)
    wanted = set(spread_evenly(plan.frames_count, _CALIBRATION_INPUTS))
    for number, item in enumerate(plan.frames()):
        if number in wanted:
            hints = vehicle_knowledge(item, point_counts).hints(modes[len(recorder.inputs) % len(modes)])
            recording.infer(item.frame.image_bgr, item.frame.camera, hints)
    return recorder.inputs


def _cost(
    before: DepthModel, after: DepthModel, plan: EvaluationPlan, point_counts: Sequence[int]
) -> QuantizationCost:
    modes = hint_modes(before.card.hints, point_counts)
    errors: dict[tuple[str, str], list[float]] = {}
    for item in plan.frames():
        knowledge = vehicle_knowledge(item, point_counts)
        truth = knowledge.without_points(item.frame.depth_m)
        for mode in modes:
            for name, model in (("float", before), ("int8", after)):
                error = _abs_rel(model, item, knowledge.hints(mode), truth)
                if error is not None:
                    errors.setdefault((name, mode.label), []).append(error)
    if not errors:
        raise EvaluationError("no picture shows enough known depth to judge the 8-bit network by")
    means = {key: float(np.mean(values)) for key, values in errors.items()}
    return QuantizationCost(
        {label: mean for (name, label), mean in means.items() if name == "float"},
        {label: mean for (name, label), mean in means.items() if name == "int8"},
    )


def _abs_rel(
    model: DepthModel, item: EvaluationFrame, hints: Hints, truth: NDArray[np.float32]
) -> float | None:
    depth_m = model.infer(item.frame.image_bgr, item.frame.camera, hints).depth_m
    knows_metres = model.card.metric and (hints.ground is not None or hints.points is not None)
    factor = 1.0 if knows_metres else median_factor(truth, depth_m)
    metrics = None if factor is None else depth_metrics(truth, depth_m, factor)
    return None if metrics is None else metrics.abs_rel


def _check_cost(cost: QuantizationCost) -> None:
    for label, lost in cost.lost.items():
        if not lost <= MOST_LOST:
            raise ExportError(
                f"with hints '{label}' Abs Rel grows from {cost.float_abs_rel[label]:.4f} to "
                f"{cost.int8_abs_rel[label]:.4f}, by {lost:.1%}: at most {MOST_LOST:.0%} is allowed; "
                "keep more of the network in floating point"
            )


@contextmanager
def _quiet_quantizer() -> Iterator[None]:
    """It warns that graphs may be simplified first, which ours are."""
    root = logging.getLogger()
    level = root.level
    root.setLevel(logging.ERROR)
    try:
        yield
    finally:
        root.setLevel(level)
