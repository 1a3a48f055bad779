"""Measuring a self-supervised network: the truth's own size, one factor a picture, nothing hidden."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import pytest
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from training.errors import EvaluationError
from training.evaluation_sheet import write_sheet
from training.sequence_evaluation import SequenceReport, evaluate_disparity_network
from training.sequences.garg_crop import garg_mask
from training.sequences.kitti_raw import open_kitti_raw
from uavdepth.errors import UavDepthError

REAL = Path(__file__).parents[3] / "shared" / "data" / "kitti_raw"
WIDTH, HEIGHT = 96, 64
NEAR_M, FAR_M = 0.1, 100.0


class ReadsThePaint(nn.Module):
    """A network that knows: brightness is the disparity, times a factor that it gets wrong."""

    def __init__(self, gain: float = 1.0) -> None:
        super().__init__()
        self.gain = nn.Parameter(torch.tensor(gain))
        self.seen: list[tuple[int, ...]] = []

    def forward(self, image: Tensor) -> tuple[Tensor, ...]:
        self.seen.append(tuple(image.shape))
        disparity = image.mean(dim=1, keepdim=True) * self.gain
        return disparity, nn.functional.avg_pool2d(disparity, 2)


@dataclass
class PaintedSequence:
    """Pictures whose brightness is the disparity of their truth, with defects where asked for."""

    name: str = "painted"
    count: int = 3
    broken: int | None = None
    truthless: int | None = None
    ill_sized: int | None = None
    hollow: float | None = None

    def __len__(self) -> int:
        return self.count

    def image_bgr(self, index: int) -> NDArray[np.uint8]:
        if index == self.broken:
            raise UavDepthError("0001.png cannot be read")
        if index == self.ill_sized:
            return np.zeros((10, 10, 3), np.uint8)
        return np.repeat(codes(index)[..., None], 3, axis=2)

    def truth_m(self, index: int) -> NDArray[np.float32] | None:
        if index == self.truthless:
            return None
        disparity = codes(index).astype(np.float32) / 255.0
        depth = 1.0 / (1.0 / FAR_M + (1.0 / NEAR_M - 1.0 / FAR_M) * disparity)
        if self.hollow is not None:
            depth[:, ::2] = self.hollow
        return depth.astype(np.float32)


def codes(index: int) -> NDArray[np.uint8]:
    """(HEIGHT, WIDTH) codes of 0.4 to 10 m, other ones for every picture."""
    row = np.linspace(2 + index, 60, HEIGHT).astype(np.uint8)
    return np.repeat(row[:, None], WIDTH, axis=1)


def measure(sequence: PaintedSequence, network: nn.Module | None = None, **options: int) -> SequenceReport:
    return evaluate_disparity_network(network or ReadsThePaint(), [sequence], WIDTH, HEIGHT, **options)


def test_a_network_that_knows_the_disparity_makes_no_errors() -> None:
    content = measure(PaintedSequence()).as_json()
    assert content["pictures"] == 3
    for scale in ("median_scaled", "unscaled"):
        assert content[scale]["abs_rel"] == pytest.approx(0.0, abs=1e-5)
        assert content[scale]["below_125"] == 1.0
    assert content["median_factor"]["median"] == pytest.approx(1.0, abs=1e-5)
    assert content["constant_depth_median_scaled"]["abs_rel"] > 0.2


def test_the_median_mends_a_wrong_scale_and_the_report_says_by_how_much() -> None:
    content = measure(PaintedSequence(), ReadsThePaint(0.5)).as_json()
    # Near things keep 1/d proportional to the disparity; the far end (1/100 m) does not halve with it.
    assert content["median_factor"]["median"] == pytest.approx(0.5, rel=0.05)
    assert content["unscaled"]["abs_rel"] == pytest.approx(1.0, abs=0.1)
    assert content["median_scaled"]["abs_rel"] < 0.05


def test_the_network_sees_its_own_size_and_is_scored_at_the_truths() -> None:
    network = ReadsThePaint()
    report = evaluate_disparity_network(network, [PaintedSequence()], 32, 32, sheet_rows=1)
    assert set(network.seen) == {(1, 3, 32, 32)}
    assert report.rows[0].predicted_m.shape == (HEIGHT, WIDTH)
    assert report.as_json()["median_scaled"]["abs_rel"] < 0.05


@pytest.mark.parametrize("nothing", [0.0, np.nan, np.inf, -1.0])
def test_pixels_without_a_truth_are_not_scored(nothing: float) -> None:
    content = measure(PaintedSequence(hollow=nothing)).as_json()
    assert content["unscaled"]["abs_rel"] == pytest.approx(0.0, abs=1e-5)


def test_a_picture_without_any_truth_is_skipped_and_named() -> None:
    @dataclass
    class Blank(PaintedSequence):
        def truth_m(self, index: int) -> NDArray[np.float32] | None:
            return super().truth_m(index) if index else np.zeros((HEIGHT, WIDTH), np.float32)

    report = measure(Blank())
    assert [where for where, _ in report.skipped] == ["painted #0"]
    assert len(report.pictures) == 2


@pytest.mark.parametrize(
    ("sequence", "why"),
    [
        (PaintedSequence(broken=1), "cannot be read"),
        (PaintedSequence(truthless=1), "no truth"),
        (PaintedSequence(ill_sized=1), "10x10"),
    ],
)
def test_what_cannot_be_measured_is_counted_with_its_reason(sequence: PaintedSequence, why: str) -> None:
    report = measure(sequence)
    ((where, reason),) = report.skipped
    assert where == "painted #1"
    assert why in reason
    assert report.as_json()["pictures"] == 2


def test_nothing_measured_is_an_error_that_says_why() -> None:
    with pytest.raises(EvaluationError, match=r"painted #0: .*no truth"):
        measure(PaintedSequence(count=1, truthless=0))
    with pytest.raises(EvaluationError, match="empty"):
        measure(PaintedSequence(count=0))


def test_a_network_whose_training_broke_down_is_not_averaged_away() -> None:
    with pytest.raises(EvaluationError, match="not finite"):
        measure(PaintedSequence(), ReadsThePaint(float("nan")))


@pytest.mark.parametrize("size", [(100, 64), (96, 60), (0, 64)])
def test_an_input_that_the_encoder_cannot_halve_five_times_is_refused(size: tuple[int, int]) -> None:
    with pytest.raises(EvaluationError, match="multiples of 32"):
        evaluate_disparity_network(ReadsThePaint(), [PaintedSequence()], *size)


def test_every_second_picture_of_each_sequence_counts_alike() -> None:
    sequences = [PaintedSequence("first", 5), PaintedSequence("second", 2)]
    report = evaluate_disparity_network(ReadsThePaint(0.7), sequences, WIDTH, HEIGHT, every=2)
    assert [(item.sequence, item.index) for item in report.pictures] == [
        ("first", 0),
        ("first", 2),
        ("first", 4),
        ("second", 0),
    ]
    content = report.as_json()
    parts = [content["by_sequence"][name]["median_scaled"]["abs_rel"] for name in ("first", "second")]
    assert content["median_scaled"]["abs_rel"] == pytest.approx((3 * parts[0] + parts[1]) / 4, abs=1e-5)


def test_only_the_mask_is_scored() -> None:
    def lower_half(height: int, width: int) -> NDArray[np.bool_]:
        mask = np.zeros((height, width), np.bool_)
        mask[height // 2 :] = True
        return mask

    class WrongAbove(ReadsThePaint):
        def forward(self, image: Tensor) -> tuple[Tensor, ...]:
            disparity = super().forward(image)[0].clone()
            disparity[:, :, : HEIGHT // 2] *= 0.3
            return (disparity,)

    sequences = [PaintedSequence()]
    whole = evaluate_disparity_network(WrongAbove(), sequences, WIDTH, HEIGHT)
    half = evaluate_disparity_network(WrongAbove(), sequences, WIDTH, HEIGHT, mask=lower_half)
    assert half.as_json()["unscaled"]["abs_rel"] == pytest.approx(0.0, abs=1e-5)
    assert whole.as_json()["unscaled"]["abs_rel"] > 0.3


def test_the_report_is_the_same_again_and_the_networks_mode_stays() -> None:
    network = nn.Sequential(nn.Dropout(0.5), ReadsThePaint())
    network.train()

    class First(nn.Module):
        def __init__(self) -> None:
            super().__init__()
            self.inner = network

        def forward(self, image: Tensor) -> tuple[Tensor, ...]:
            return tuple(self.inner(image))

    first, second = (measure(PaintedSequence(), First()).as_json() for _ in range(2))
    assert json.dumps(first) == json.dumps(second)
    assert first["unscaled"]["abs_rel"] == pytest.approx(0.0, abs=1e-5), "dropout is off"
    assert network.training


def test_the_sheet_shows_pictures_spread_over_all(tmp_path: Path) -> None:
    report = measure(PaintedSequence(count=9), sheet_rows=3)
    assert [row.caption.partition("  ")[0] for row in report.rows] == [
        "painted #1",
        "painted #4",
        "painted #7",
    ]
    write_sheet(tmp_path / "sheet.png", report.rows)
    picture = cv2.imread(str(tmp_path / "sheet.png"))
    assert picture is not None
    assert picture.shape[1] > 4 * 300


@pytest.mark.skipif(not REAL.is_dir(), reason="KITTI samples (../shared/data) are not part of the project")
def test_on_real_pictures_a_network_that_never_looks_is_the_constant_depth() -> None:
    class NeverLooks(nn.Module):
        def forward(self, image: Tensor) -> tuple[Tensor, ...]:
            return (torch.full_like(image[:, :1], 0.3),)

    drives = open_kitti_raw(REAL)[:1]
    content = evaluate_disparity_network(NeverLooks(), drives, 128, 64, every=5, mask=garg_mask).as_json()
    assert content["pictures"] == 2
    assert content["median_scaled"] == content["constant_depth_median_scaled"]
    assert content["median_scaled"]["abs_rel"] == pytest.approx(0.43, abs=0.05)
