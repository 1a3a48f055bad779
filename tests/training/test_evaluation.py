"""Evaluation: only worlds that training never saw, every hint beside the baselines, nothing left out."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import cast

import cv2
import numpy as np
import pytest
from frames import HEIGHT, WIDTH, ground_frame, make_store
from knowing_network import KnowingNetwork

from training.commands import evaluate
from training.data.frame_store import read_frames
from training.data.seed_split import SeedSplit
from training.errors import EvaluationError, TrainingDataError
from training.evaluation import FrameErrors, MeasuredFrame, measure_frame
from training.evaluation_command import parse_points
from training.evaluation_frames import EvaluationFrame, EvaluationPlan, parse_seeds
from training.evaluation_run import evaluate_rendered, indices_for_sheet
from training.evaluation_sources import (
    CONSTANT,
    FLAT_GROUND,
    GROUND_SCALED,
    PERFECT,
    THERE,
    Sources,
    nearest_of,
    points_scaled,
)
from training.evaluation_summary import summarise
from training.evaluation_tables import tables
from uavdepth.depth_model import DepthModel
from uavdepth.errors import ImageSizeError


def measured(network: KnowingNetwork | None = None, **changes: object) -> MeasuredFrame:
    frame = replace(ground_frame(3.0, -0.3), **changes)
    network = network or KnowingNetwork(frame.depth_m * np.float32(0.5))
    sources = Sources(cast(DepthModel, network), (100,))
    return measure_frame(sources, EvaluationFrame("city", 1000, 0, frame))


def test_a_network_of_the_right_shape_is_right_once_scaled() -> None:
    sources = measured().errors.sources
    plain = sources["none"]
    assert plain.scaled.overall.abs_rel == pytest.approx(0.0, abs=1e-5)
    assert plain.metric is not None
    assert plain.metric.overall.abs_rel == pytest.approx(0.5, abs=1e-3)
    assert plain.factor == pytest.approx(2.0)
    for label, error in ((GROUND_SCALED, 0.06), (points_scaled(100), 0.15), (FLAT_GROUND, 0.06)):
        found = sources[label].metric
        assert found is not None
        assert found.overall.abs_rel < error, f"{label}: as wrong as what the vehicle knows"
    assert sources[CONSTANT].scaled.overall.abs_rel > 0.1
    assert sources[nearest_of(100)].metric is not None


def test_hints_reach_a_network_that_takes_them_and_each_is_measured_apart() -> None:
    frame = ground_frame(3.0, -0.3)
    network = KnowingNetwork(
        frame.depth_m, hints=("ground", "points"), relative_error={0: -0.4, 1: -0.2, 2: 0.0}
    )
    sources = measured(network).errors.sources
    errors = {}
    for label in ("none", "ground", "ground+100 points"):
        found = sources[label].metric
        assert found is not None
        errors[label] = found.overall.abs_rel
    assert errors == {
        "none": pytest.approx(0.4, abs=1e-4),
        "ground": pytest.approx(0.2, abs=1e-4),
        "ground+100 points": pytest.approx(0.0, abs=1e-4),
    }
    assert GROUND_SCALED not in sources, "a network that takes the ground needs no scale from it"
    assert points_scaled(100) not in sources


def test_without_a_height_there_is_no_ground_hint_but_the_frame_still_counts() -> None:
    frame = ground_frame(3.0, -0.3)
    network = KnowingNetwork(frame.depth_m, hints=("ground",), relative_error={0: -0.4, 1: -0.2})
    sources = measured(network, height_m=None).errors.sources
    found = sources["ground"].metric
    assert found is not None
    assert found.overall.abs_rel == pytest.approx(0.4, abs=1e-4)
    assert FLAT_GROUND not in sources


def test_metres_of_a_network_that_has_none_are_not_reported() -> None:
    frame = ground_frame(3.0, -0.3)
    sources = measured(KnowingNetwork(frame.depth_m * np.float32(0.1), metric=False)).errors.sources
    assert sources["none"].metric is None
    assert sources["none"].elements is None
    assert sources["none"].scaled.overall.abs_rel == pytest.approx(0.0, abs=1e-4)
    scaled = sources[GROUND_SCALED].metric
    assert scaled is not None
    assert scaled.overall.abs_rel < 0.06


def test_a_perfect_network_misses_nothing_but_what_the_vehicle_gets_wrong() -> None:
    found = measured().errors.sources[PERFECT]
    assert found.metric is not None
    assert found.metric.overall.abs_rel < 1e-6
    assert found.elements is not None


def test_sigma_is_held_against_the_metric_error() -> None:
    frame = ground_frame(3.0, -0.3)
    honest = (
        measured(KnowingNetwork(frame.depth_m * np.float32(1.05), sigma=0.1)).errors.sources["none"].doubt
    )
    boasting = (
        measured(KnowingNetwork(frame.depth_m * np.float32(1.5), sigma=0.1)).errors.sources["none"].doubt
    )
    assert honest is not None
    assert boasting is not None
    assert honest.within_one_sigma == 1.0
    assert boasting.within_one_sigma == 0.0


def test_unknown_pixels_are_counted_and_not_scored() -> None:
    frame = ground_frame(3.0, -0.3)
    holed = frame.depth_m.copy()
    holed[:, : WIDTH // 4] = np.nan
    found = measured(KnowingNetwork(holed)).errors.sources["none"]
    assert found.unknown_share == pytest.approx(0.25, abs=0.02)
    assert found.scaled.overall.abs_rel == pytest.approx(0.0, abs=1e-5)


@pytest.mark.parametrize("nothing", [np.nan, 0.0, np.inf])
def test_a_frame_without_a_truth_has_no_errors_and_is_named(nothing: float) -> None:
    frame = ground_frame(3.0, -0.3)
    blank = np.full_like(frame.depth_m, nothing)
    item = measured(KnowingNetwork(frame.depth_m), depth_m=blank)
    assert item.errors.sources == {}
    assert item.row.caption == "city:1000 #0"


def test_a_network_that_says_nothing_is_not_averaged_as_right() -> None:
    frame = ground_frame(3.0, -0.3)
    errors = [measured(KnowingNetwork(np.full_like(frame.depth_m, np.nan))).errors]
    (row,) = summarise(errors, ["none"])
    assert row.frames == 0
    assert row.scaled is None
    assert row.as_json()["metric"] is None


def test_a_source_without_an_answer_is_averaged_over_the_frames_that_it_has() -> None:
    seeing, blind = measured().errors, measured(height_m=None).errors
    rows = {row.label: row for row in summarise([seeing, blind], ["none", FLAT_GROUND, THERE])}
    assert rows["none"].frames == 2
    assert rows[FLAT_GROUND].frames == rows[THERE].frames == 1


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


def test_a_world_measures_the_same_whether_it_was_stored_or_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rng = np.random.default_rng(1)
    noisy = rng.integers(0, 255, (HEIGHT, WIDTH, 3)).astype(np.uint8)
    rendered = [replace(ground_frame(3.0), image_bgr=noisy)]
    monkeypatch.setattr("training.evaluation_frames.load_scene", lambda *_: None)
    monkeypatch.setattr("training.evaluation_frames.render_world", lambda *_: rendered)
    (unstored,) = EvaluationPlan(("city",), (1000,), 1).frames()
    plan = EvaluationPlan(("city",), (1000,), 1, tmp_path)
    (written,), (read,) = plan.frames(), plan.frames()
    for item in (written, read):
        assert np.array_equal(item.frame.image_bgr, unstored.frame.image_bgr)
        assert np.array_equal(item.frame.depth_m, unstored.frame.depth_m)


def test_a_stored_picture_of_another_size_is_named(tmp_path: Path) -> None:
    make_store(tmp_path, (("city", 1000),))
    cv2.imwrite(str(tmp_path / "city-001000" / "0001.jpg"), np.zeros((10, 20, 3), np.uint8))
    plan = EvaluationPlan(("city",), (1000,), 2, tmp_path)
    with pytest.raises(
        TrainingDataError, match=rf"0001\.jpg is 20x10 pixels, its camera is {WIDTH}x{HEIGHT}"
    ):
        list(plan.frames())


def test_a_stored_depth_that_cannot_be_read_is_named(tmp_path: Path) -> None:
    make_store(tmp_path, (("city", 1000),))
    (tmp_path / "city-001000" / "0000.png").write_bytes(b"not a picture")
    with pytest.raises(TrainingDataError, match=r"0000\.png"):
        list(EvaluationPlan(("city",), (1000,), 1, tmp_path).frames())


def test_a_camera_that_does_not_fit_its_picture_stops_the_measuring() -> None:
    with pytest.raises(ImageSizeError, match="10x10"):
        DepthModel.load("default", "cpu", 1).infer(np.zeros((10, 10, 3), np.uint8), ground_frame().camera)


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


def test_counts_of_points_are_read() -> None:
    assert parse_points("20, 100") == (20, 100)
    for text in ("", "x", "1.5", "-3", "20,"):
        with pytest.raises(EvaluationError, match="points"):
            parse_points(text)


def test_the_sheet_takes_as_many_frames_of_each_scene() -> None:
    plan = EvaluationPlan(("city", "wall", "forest"), (1000, 1001), 12)
    numbers = indices_for_sheet(plan)
    scenes = [(number // 12) % 3 for number in numbers]
    assert max(numbers) < plan.frames_count
    assert [scenes.count(scene) for scene in range(3)] == [8, 8, 8]
    assert {number // 36 for number in numbers} == {0, 1}


def test_the_sheets_row_shows_what_the_network_said_with_all_its_hints() -> None:
    frame = ground_frame(3.0, -0.3)
    network = KnowingNetwork(
        frame.depth_m, hints=("ground", "points"), relative_error={0: -0.4, 1: -0.2, 2: 0.0}
    )
    row = measured(network).row
    assert row.caption.startswith("city:1000 #0   ground+100 points: Abs Rel 0.000 as given")
    ground = frame.depth_m < 80
    assert np.allclose(row.predicted_m[ground], frame.depth_m[ground], rtol=1e-4)


def test_kinds_of_scene_that_were_never_trained_on_are_reported_apart(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("training.evaluation_frames.HELD_OUT_SCENES", ("wall",))
    make_store(tmp_path, (("city", 1000), ("wall", 1000)))
    network = cast(DepthModel, KnowingNetwork(ground_frame(3.0).depth_m))
    plan = EvaluationPlan(("city", "wall"), (1000,), 2, tmp_path)
    report = evaluate_rendered(network, plan, (20,)).report
    content = json.loads(json.dumps(report.as_json()))
    assert {name: part["groups"] for name, part in content["parts"].items()} == {
        "seen": ["city"],
        "held_out": ["wall"],
    }
    assert content["parts"]["seen"]["frames"] == content["parts"]["held_out"]["frames"] == 2
    assert content["overall"]["frames"] == 4
    assert set(content["summary"]) >= {"data", "date", "frames", "seen", "held_out"}
    titles = [str(table.title) for table in tables(report)]
    for part in ("seen", "held_out"):
        assert [title.partition(": ")[2] for title in titles if title.startswith(part)][1:] == [
            "Abs Rel by true distance",
            "sigma against the error, metric",
            "what is said of the sky",
            "nearest obstacle of each 5 degree element",
        ]


def test_all_of_the_result_is_plain_json_with_every_figure(tmp_path: Path) -> None:
    make_store(tmp_path, (("city", 1000),))
    network = cast(DepthModel, KnowingNetwork(ground_frame(3.0).depth_m))
    report = evaluate_rendered(network, EvaluationPlan(("city",), (1000,), 3, tmp_path), (100,)).report
    content = json.loads(json.dumps(report.as_json()))
    plain = content["overall"]["sources"]["none"]
    assert len(plain["median_scaled"]) == len(plain["metric"]) == 7
    assert [band["to_m"] for band in plain["bands"]] == [2, 5, 10, 20, 40, 80]
    assert [line["sigmas"] for line in plain["sigma"]["reliability"]] == [0.5, 1.0, 1.5, 2.0]
    assert set(plain["nearest_obstacle"]) >= {"median_relative_error", "missed_share", "false_alarm_share"}
    for label in (CONSTANT, FLAT_GROUND, PERFECT):
        assert content["overall"]["sources"][label]["frames"] == 3


def test_the_same_frames_give_the_same_result(tmp_path: Path) -> None:
    make_store(tmp_path, (("city", 1000),))
    network = cast(DepthModel, KnowingNetwork(ground_frame(3.0).depth_m))
    plan = EvaluationPlan(("city",), (1000,), 2, tmp_path)
    first, second = (evaluate_rendered(network, plan, (100,)).report.as_json() for _ in range(2))
    first["date"] = second["date"] = first["summary"]["date"] = second["summary"]["date"] = ""
    assert json.dumps(first) == json.dumps(second)


def test_validation_seeds_are_marked_as_for_choices(tmp_path: Path) -> None:
    make_store(tmp_path, (("city", 900),))
    network = cast(DepthModel, KnowingNetwork(ground_frame(3.0).depth_m))
    plan = EvaluationPlan(("city",), (900,), 1, tmp_path)
    assert plan.split is SeedSplit.VALIDATION
    assert "for choices" in evaluate_rendered(network, plan, (100,)).report.note


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
        as_json="-",
        sheet=tmp_path / "sheet.png",
    )
    content = json.loads(capsys.readouterr().out)
    assert content["split"] == "test"
    assert content["overall"]["frames"] == 2
    assert content["overall"]["sources"]["none"]["median_scaled"]["abs_rel"] < 2.0
    sheet = cv2.imread(str(tmp_path / "sheet.png"))
    assert sheet is not None
    assert sheet.shape[1] > 5 * 300, "camera, truth, network, error and sigma"


def test_the_command_writes_its_result_beside_the_tables(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    make_store(tmp_path / "frames", (("city", 1000),))
    target = tmp_path / "results" / "evaluation.json"
    evaluate(
        "default", "city", "1000", 1, tmp_path / "frames", provider="cpu", threads=1, as_json=str(target)
    )
    assert json.loads(target.read_text())["overall"]["frames"] == 1
    assert "nearest obstacle of each 5 degree element" in capsys.readouterr().out


def test_a_result_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    make_store(tmp_path / "frames", (("city", 1000),))
    (tmp_path / "file").write_text("")
    with pytest.raises(EvaluationError, match=r"cannot write the result .*result\.json"):
        evaluate(
            "default",
            "city",
            "1000",
            1,
            tmp_path / "frames",
            provider="cpu",
            threads=1,
            as_json=str(tmp_path / "file" / "result.json"),
        )


def test_a_summary_of_no_frames_is_empty() -> None:
    none: list[FrameErrors] = []
    assert [row.frames for row in summarise(none, ["none"])] == [0]
