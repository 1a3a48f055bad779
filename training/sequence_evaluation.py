"""Measures a self-supervised network, whose scale is free, on sequences with a truth."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Protocol

import cv2
import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from training.errors import EvaluationError
from training.evaluation_sheet import SheetRow, spread_evenly
from training.metrics import DEPTH_CAP_M, SMALLEST_DEPTH_M, DepthMetrics, depth_metrics, median_factor
from training.networks.disparity import disparity_to_depth
from uavdepth.errors import UavDepthError

_STRIDE_OF_NETWORKS = 32
_DIGITS = 6

Mask = Callable[[int, int], NDArray[np.bool_]]
"""Pixels of a picture (height, width) that are scored, such as the Garg crop."""


class MeasuredSequence(Protocol):
    """The part of a sequence of frames that is needed here."""

    @property
    def name(self) -> str: ...

    def __len__(self) -> int: ...

    def image_bgr(self, index: int, /) -> NDArray[np.uint8]: ...

    def truth_m(self, index: int, /) -> NDArray[np.float32] | None: ...


@dataclass(frozen=True)
class PictureErrors:
    """Errors on one picture.

    Args:
        sequence, index: which.
        factor: median of the truth over median of the prediction.
        scaled: errors after that factor was applied, with the truth's help, as KITTI's tables have them.
        unscaled: errors of the network's own depth; meaningful where training knew metres.
        constant: errors of one depth everywhere, the truth's median.
    """

    sequence: str
    index: int
    factor: float
    scaled: DepthMetrics
    unscaled: DepthMetrics
    constant: DepthMetrics


@dataclass(frozen=True)
class SequenceReport:
    """Errors of one network on sequences.

    Args:
        width, height: the network's input, pixels.
        every: one picture of so many was measured.
        pictures: errors of each.
        skipped: what could not be measured, and why.
        rows: pictures for a sheet.
    """

    width: int
    height: int
    every: int
    pictures: tuple[PictureErrors, ...]
    skipped: tuple[tuple[str, str], ...]
    rows: tuple[SheetRow, ...]

    def as_json(self) -> dict[str, Any]:
        """Everything but the rows as plain values; means over pictures, each counting alike."""
        names = dict.fromkeys(item.sequence for item in self.pictures)
        return {
            "input": [self.width, self.height],
            "every": self.every,
            "depth_m": [SMALLEST_DEPTH_M, DEPTH_CAP_M],
            "pictures": len(self.pictures),
            "skipped": [list(item) for item in self.skipped],
            **_means(self.pictures),
            "by_sequence": {
                name: _means([item for item in self.pictures if item.sequence == name]) for name in names
            },
        }


def evaluate_disparity_network(
    network: nn.Module,
    sequences: Sequence[MeasuredSequence],
    width: int,
    height: int,
    every: int = 1,
    *,
    min_depth_m: float = 0.1,
    max_depth_m: float = 100.0,
    mask: Mask | None = None,
    sheet_rows: int = 0,
    done: Callable[[int, int], None] | None = None,
) -> SequenceReport:
    """Compare a disparity network with the truth, median-scaled per picture, at the truth's own size.

    Pictures are resized to the network's input by area, one at a time, in the network's own precision;
    disparity is brought to the truth's size bilinearly (as Monodepth2 does) and becomes depth there. Truth
    from `SMALLEST_DEPTH_M` to `DEPTH_CAP_M` is scored, predictions are cut off at both. The same network and
    sequences give the same report.

    Args:
        network: RGB (N, 3, H, W) in 0..1 -> sigmoid disparities, finest first; left in the mode it was in.
        sequences: whose pictures with a truth are measured; others are counted as skipped.
        width, height: the network's input, pixels, divisible by 32.
        every: one picture of so many is taken, from the first of each sequence.
        min_depth_m, max_depth_m: what disparities 1 and 0 mean, as in training.
        mask: pixels to score; None: all.
        sheet_rows: pictures to keep for a sheet (`training.evaluation_sheet.write_sheet`).
        done: called with pictures done and their number after each.

    Raises:
        EvaluationError: an impossible size, no picture that could be measured, or a network whose
            answer is not finite.
    """
    if width % _STRIDE_OF_NETWORKS or height % _STRIDE_OF_NETWORKS or width < 1 or height < 1:
        raise EvaluationError(f"the network's input is {width}x{height}: multiples of 32 are needed")
    if every < 1:
        raise EvaluationError(f"every is {every}: 1 or more is needed")
    chosen = [(item, index) for item in sequences for index in range(0, len(item), every)]
    shown = set(spread_evenly(len(chosen), sheet_rows)) if sheet_rows else set()
    pictures: list[PictureErrors] = []
    skipped: list[tuple[str, str]] = []
    rows: list[SheetRow] = []
    with _measuring(network) as device:
        for number, (sequence, index) in enumerate(chosen):
            where = f"{sequence.name} #{index}"
            try:
                image, truth = _read(sequence, index, mask)
            except UavDepthError as error:
                skipped.append((where, str(error)))
            else:
                disparity = network(_network_input(image, width, height).to(device))[0]
                predicted = _depth_at(disparity, truth.shape, min_depth_m, max_depth_m, where)
                errors = _errors(sequence.name, index, truth, predicted)
                if errors is None:
                    skipped.append((where, "too few pixels with a truth"))
                else:
                    pictures.append(errors)
                    if number in shown:
                        rows.append(_row(errors, image, truth, predicted))
            if done is not None:
                done(number + 1, len(chosen))
    if not pictures:
        reasons = "; ".join(f"{where}: {why}" for where, why in skipped[:3]) or "the sequences are empty"
        raise EvaluationError(f"no picture could be measured ({reasons})")
    return SequenceReport(width, height, every, tuple(pictures), tuple(skipped), tuple(rows))


@contextmanager
def _measuring(network: nn.Module) -> Iterator[torch.device]:
    """Evaluation mode without gradients, and back to the mode it was in; yields where the weights lie."""
    was_training = network.training
    first = next(network.parameters(), None)
    network.eval()
    try:
        with torch.no_grad():
            yield torch.device("cpu") if first is None else first.device
    finally:
        network.train(was_training)


def _read(
    sequence: MeasuredSequence, index: int, mask: Mask | None
) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
    truth = sequence.truth_m(index)
    if truth is None:
        raise EvaluationError("it has no truth")
    image = sequence.image_bgr(index)
    if image.shape[:2] != truth.shape:
        raise EvaluationError(
            f"the picture is {image.shape[1]}x{image.shape[0]}, its truth {truth.shape[1]}x{truth.shape[0]}"
        )
    if mask is not None:
        truth = np.where(mask(*truth.shape), truth, np.float32(np.nan))
    return image, truth


def _network_input(image_bgr: NDArray[np.uint8], width: int, height: int) -> Tensor:
    """(1, 3, height, width) RGB in 0..1."""
    if image_bgr.shape[:2] != (height, width):
        image_bgr = np.asarray(cv2.resize(image_bgr, (width, height), interpolation=cv2.INTER_AREA))
    rgb = np.ascontiguousarray(image_bgr[:, :, ::-1].transpose(2, 0, 1))
    return torch.from_numpy(rgb)[None].float() / 255.0


def _depth_at(
    disparity: Tensor, shape: tuple[int, ...], min_depth_m: float, max_depth_m: float, where: str
) -> NDArray[np.float32]:
    """(H, W) float32 depth of a (1, 1, h, w) disparity at the truth's size."""
    resized = nn.functional.interpolate(disparity.float(), list(shape), mode="bilinear", align_corners=False)
    depth = disparity_to_depth(resized, min_depth_m, max_depth_m)[0, 0].cpu().numpy()
    if not np.isfinite(depth).all():
        raise EvaluationError(f"the network's answer to {where} is not finite: its training broke down")
    return np.asarray(depth, np.float32)


def _errors(
    sequence: str, index: int, truth: NDArray[np.float32], predicted: NDArray[np.float32]
) -> PictureErrors | None:
    factor = median_factor(truth, predicted)
    level = np.ones_like(truth)
    middle = median_factor(truth, level)
    if factor is None or middle is None:
        return None
    scaled, unscaled = depth_metrics(truth, predicted, factor), depth_metrics(truth, predicted)
    constant = depth_metrics(truth, level, middle)
    if scaled is None or unscaled is None or constant is None:
        return None
    return PictureErrors(sequence, index, factor, scaled, unscaled, constant)


def _row(
    errors: PictureErrors,
    image: NDArray[np.uint8],
    truth: NDArray[np.float32],
    predicted: NDArray[np.float32],
) -> SheetRow:
    caption = (
        f"{errors.sequence} #{errors.index}  Abs Rel {errors.scaled.abs_rel:.3f} median-scaled "
        f"(constant depth {errors.constant.abs_rel:.3f}), factor {errors.factor:.2f}"
    )
    return SheetRow(caption, image, truth, predicted * np.float32(errors.factor))


def _means(pictures: Sequence[PictureErrors]) -> dict[str, Any]:
    factors = np.array([item.factor for item in pictures], np.float64)
    middle = float(np.median(factors))
    return {
        "median_scaled": _mean([item.scaled for item in pictures]),
        "unscaled": _mean([item.unscaled for item in pictures]),
        "constant_depth_median_scaled": _mean([item.constant for item in pictures]),
        "median_factor": {
            "median": round(middle, _DIGITS),
            "log_spread": round(float(np.std(np.log(factors / middle))), _DIGITS),
        },
    }


def _mean(metrics: Sequence[DepthMetrics]) -> dict[str, float]:
    count = len(metrics)
    columns = {key: [item.as_dict()[key] for item in metrics] for key in metrics[0].as_dict()}
    return {key: round(math.fsum(values) / count, _DIGITS) for key, values in columns.items()}
