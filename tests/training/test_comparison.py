"""The comparison: the same budget for all, and tables that say what the results say."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import pytest

from training.comparison.figure import write_figure
from training.comparison.plan import IMAGE_STEPS, run_settings
from training.comparison.result import ComparisonResult
from training.comparison.tables import read_results, write_tables
from training.errors import EvaluationError
from training.networks.catalogue import NETWORK_NAMES

METRICS = {
    "abs_rel": 0.2,
    "sq_rel": 1.3,
    "rmse": 5.5,
    "rmse_log": 0.3,
    "below_125": 0.78,
    "below_125_2": 0.94,
    "below_125_3": 0.98,
}
CONSTANT = {**METRICS, "abs_rel": 0.5}


def make_result(network: str, abs_rel: float, **changes: Any) -> ComparisonResult:
    scene = {
        "pictures": 7,
        "median_scaled": {**METRICS, "abs_rel": abs_rel},
        "constant_depth_median_scaled": CONSTANT,
    }
    settings = run_settings(network, Path("data")).model_dump(mode="json", exclude={"sources", "cache"})
    result = ComparisonResult(
        network=network,
        parameters=14_000_000,
        multiply_adds=800_000_000,
        settings=settings,
        images=IMAGE_STEPS,
        trained_minutes=80.0,
        machine="test",
        date="2026-11-22T05:00+00:00",
        scenes={"mountain": scene, "city": scene},
    )
    return replace(result, **changes)


def test_runs_differ_by_their_network_alone() -> None:
    tables = [run_settings(name, Path("data")).model_dump() for name in NETWORK_NAMES]
    assert len({table["network"].pop("name") for table in tables}) == len(NETWORK_NAMES)
    assert all(table == tables[0] for table in tables)


def test_every_run_has_at_least_the_budget_that_was_asked_for() -> None:
    assert all(run_settings(name, Path("data")).image_steps >= 30_000 for name in NETWORK_NAMES)


def test_a_result_comes_back_as_it_was_written(tmp_path: Path) -> None:
    result = make_result("bl", 0.2)
    assert ComparisonResult.read(result.write(tmp_path)) == result


@pytest.mark.parametrize(("abs_rel", "words"), [(0.18, "10.0% below"), (0.24, "20.0% above")])
def test_the_table_says_honestly_who_wins(tmp_path: Path, abs_rel: float, words: str) -> None:
    folder = tmp_path / "comparison"
    make_result("monodepth2", 0.2).write(folder)
    make_result("bl+fan+eca", abs_rel).write(folder)
    text = write_tables(folder).read_text()
    assert words in text
    winner = "BL + FAN + ECA (proposed)" if abs_rel < 0.2 else "Monodepth2"
    rows = [line for line in text.splitlines() if line.startswith(f"| {winner} |") and "**" in line]
    assert len(rows) >= 2
    assert "Not there yet: HR-Depth" in text


def test_a_tie_is_won_by_nobody(tmp_path: Path) -> None:
    folder = tmp_path / "comparison"
    make_result("monodepth2", 0.2).write(folder)
    make_result("bl+fan+eca", 0.2).write(folder)
    text = write_tables(folder).read_text()
    assert "**" not in text
    assert "best in 0 of 7" in text


@pytest.mark.parametrize(
    "changes",
    [{"images": 12}, {"settings": {**make_result("bl", 0.2).settings, "learning_rate": 3e-4}}],
)
def test_runs_of_other_budgets_are_not_compared(tmp_path: Path, changes: dict[str, Any]) -> None:
    make_result("monodepth2", 0.2).write(tmp_path)
    make_result("bl", 0.2, **changes).write(tmp_path)
    with pytest.raises(EvaluationError, match="do not compare"):
        read_results(tmp_path)


def test_nothing_to_compare_names_the_command(tmp_path: Path) -> None:
    with pytest.raises(EvaluationError, match="uavdepth compare run"):
        read_results(tmp_path)


@pytest.mark.parametrize("content", ["", "{}", "[1]"])
def test_a_broken_result_is_named(tmp_path: Path, content: str) -> None:
    (tmp_path / "bl.json").write_text(content)
    with pytest.raises(EvaluationError, match=r"bl\.json"):
        read_results(tmp_path)


def test_the_figure_shows_the_variants_that_are_there(tmp_path: Path) -> None:
    folder = tmp_path / "comparison"
    make_result("bl", 0.2).write(folder)
    make_result("bl+fan", 0.19).write(folder)
    picture = cv2.imread(str(write_figure(folder)))
    assert picture is not None
    assert picture.std() > 5
