"""What an evaluation reports, and the command that runs it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import cast

import cv2
import pytest
from frames import ground_frame, make_store
from knowing_network import KnowingNetwork

from training.commands import evaluate
from training.data.seed_split import SeedSplit
from training.errors import EvaluationError
from training.evaluation import FrameErrors
from training.evaluation_frames import EvaluationPlan
from training.evaluation_run import evaluate_rendered
from training.evaluation_sources import (
    CONSTANT,
    FLAT_GROUND,
    PERFECT,
)
from training.evaluation_summary import summarise
from training.evaluation_tables import tables
from uavdepth.model.depth_model import DepthModel


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
