"""Evaluation: only worlds that training never saw, every method beside the baselines."""

from __future__ import annotations

import json
from pathlib import Path
from typing import cast

import numpy as np
import pytest
from frames import HEIGHT, WIDTH, ground_frame, make_store
from numpy.typing import NDArray

from training.commands import evaluate, indices_for_sheet, parse_seeds
from training.data.frame_store import read_frames
from training.data.seed_split import SeedSplit
from training.errors import EvaluationError
from training.evaluation import MeasuredFrame, Method, measure_frame, sheet_row, summarise
from training.evaluation_frames import EvaluationFrame, EvaluationPlan
from training.evaluation_report import EvaluationReport
from training.evaluation_sheet import draw_sheet
from uavdepth.camera import CameraModel
from uavdepth.depth_map import DepthMap
from uavdepth.depth_model import DepthModel
from uavdepth.model_card import ModelCard


class PerfectButForScale:
    """A network that knows the painted ground's shape, at half its size."""

    card = ModelCard(
        card_version=1,
        name="perfect",
        input_width=WIDTH,
        input_height=HEIGHT,
        mean=(0.0, 0.0, 0.0),
        std=(1.0, 1.0, 1.0),
        output="depth",
        metric=True,
        uncertainty=True,
        focal_px=100.0,
        max_depth_m=200.0,
        training_data="none",
        licence="Apache-2.0",
        measured={},
        created="2026-01-01T00:00:00+00:00",
    )

    def __init__(self, truth_m: NDArray[np.float32]) -> None:
        self._truth_m = truth_m

    def infer(self, image_bgr: NDArray[np.uint8], camera: CameraModel) -> DepthMap:
        return DepthMap(self._truth_m * np.float32(0.5), np.full_like(self._truth_m, 0.1))


def measured() -> tuple[EvaluationFrame, MeasuredFrame]:
    item = EvaluationFrame("city", 1000, 0, ground_frame(3.0, -0.3))
    return item, measure_frame(cast(DepthModel, PerfectButForScale(item.frame.depth_m)), item)


def test_a_network_of_the_right_shape_is_right_once_scaled_by_median_or_ground() -> None:
    _, result = measured()
    methods = result.errors.methods
    assert methods[Method.NETWORK].scaled.abs_rel == pytest.approx(0.0, abs=1e-5)
    assert methods[Method.NETWORK].unscaled.abs_rel == pytest.approx(0.5, abs=1e-3)
    assert methods[Method.GROUND_SCALED].unscaled.abs_rel == pytest.approx(0.0, abs=0.02)
    assert methods[Method.FLAT_GROUND].unscaled.abs_rel == pytest.approx(0.0, abs=1e-4)
    assert methods[Method.CONSTANT].scaled.abs_rel > 0.1
    assert result.errors.median_factor == pytest.approx(2.0)
    assert result.errors.within_sigma == 1.0


def test_the_report_sets_the_network_beside_both_baselines() -> None:
    _, result = measured()
    report = EvaluationReport(
        "perfect",
        "cpu",
        SeedSplit.TEST,
        ("city",),
        (1000,),
        1,
        [result.errors],
        "2026-01-01",
    )
    content = json.loads(json.dumps(report.as_json()))
    methods = content["overall"]["methods"]
    assert set(methods) == {"network", "ground_scaled", "network_there", "constant", "flat_ground"}
    for method in ("network", "constant", "flat_ground"):
        for scale in ("median_scaled", "unscaled"):
            assert len(methods[method][scale]) == 7
    assert content["summary"]["frames"] == 1
    assert len(report.tables()) == 1


def test_a_method_without_an_answer_is_not_averaged_as_zero() -> None:
    frame = ground_frame(3.0)
    blind = EvaluationFrame("city", 1000, 0, type(frame)(**{**vars(frame), "height_m": None}))
    result = measure_frame(cast(DepthModel, PerfectButForScale(frame.depth_m)), blind)
    rows = {row.method: row for row in summarise([result.errors])}
    assert rows[Method.FLAT_GROUND].frames == rows[Method.GROUND_SCALED].frames == 0
    assert rows[Method.FLAT_GROUND].scaled is None
    assert rows[Method.NETWORK].frames == 1


@pytest.mark.parametrize(
    ("scenes", "seeds", "frames", "complaint"),
    [
        (("city",), (3,), 1, "seed 3 is for training"),
        (("city",), (999, 1000), 1, "mixed"),
        (("moon",), (1000,), 1, "moon"),
        ((), (1000,), 1, "at least one"),
        (("city",), (), 1, "at least one"),
        (("city",), (1000,), 0, "at least one"),
    ],
)
def test_a_plan_that_proves_nothing_is_refused(
    scenes: tuple[str, ...], seeds: tuple[int, ...], frames: int, complaint: str
) -> None:
    with pytest.raises(EvaluationError, match=complaint):
        EvaluationPlan(scenes, seeds, frames)


def test_stored_frames_are_read_and_not_rendered_again(tmp_path: Path) -> None:
    make_store(tmp_path, (("city", 1000), ("wall", 1000)))
    plan = EvaluationPlan(("city", "wall"), (1000,), 2, tmp_path)
    frames = list(plan.frames())
    assert [(item.scene, item.index) for item in frames] == [
        ("city", 0),
        ("city", 1),
        ("wall", 0),
        ("wall", 1),
    ]
    stored = [record for record in read_frames(tmp_path) if record.name == "0000"]
    assert np.array_equal(frames[0].frame.depth_m, stored[0].depth_m())


@pytest.mark.parametrize(
    ("text", "seeds"),
    [("1000", (1000,)), ("1000-1002", (1000, 1001, 1002)), ("1000-1001, 1005,1001", (1000, 1001, 1005))],
)
def test_seeds_are_read_as_ranges(text: str, seeds: tuple[int, ...]) -> None:
    assert parse_seeds(text) == seeds


@pytest.mark.parametrize("text", ["", "x", "1-", "5-3", "1.5", "-1", "0-99999999"])
def test_seeds_that_cannot_be_read_are_named(text: str) -> None:
    with pytest.raises(EvaluationError, match="seeds"):
        parse_seeds(text)


def test_the_sheet_shows_picture_truth_and_prediction() -> None:
    item, result = measured()
    row = sheet_row(item, result)
    assert "city:1000" in row.caption
    assert np.allclose(row.predicted_m, row.truth_m, rtol=1e-4)
    sheet = draw_sheet([row, row, row], columns=2)
    assert sheet.dtype == np.uint8
    assert sheet.shape[1] > 8 * 300


def test_the_sheet_takes_as_many_frames_of_each_scene() -> None:
    plan = EvaluationPlan(("city", "wall", "forest"), (1000, 1001), 12)
    numbers = indices_for_sheet(plan)
    scenes = [(number // 12) % 3 for number in numbers]
    assert max(numbers) < plan.frames_count
    assert [scenes.count(scene) for scene in range(3)] == [8, 8, 8]
    assert {number // 36 for number in numbers} == {0, 1}


def test_the_command_measures_the_network_that_ships(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    make_store(tmp_path / "frames", (("city", 1000),))
    evaluate(
        "default",
        scenes="city",
        seeds="1000",
        frames_per_seed=2,
        data=tmp_path / "frames",
        provider="cpu",
        threads=1,
        as_json=True,
        sheet=tmp_path / "sheet.png",
    )
    content = json.loads(capsys.readouterr().out)
    assert content["split"] == "test"
    assert content["overall"]["frames"] == 2
    assert content["overall"]["methods"]["network"]["median_scaled"]["abs_rel"] < 2.0
    assert (tmp_path / "sheet.png").stat().st_size > 1000
