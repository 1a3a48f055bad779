"""`uavdepth evaluate-flight`: what it counts, what it says, and what it refuses."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("embreex", reason="rendered worlds need the extra sim")
from flight_worlds import NORTH, world_with

from service.cli import main
from service.fake_autopilot.autopilot import Flavor
from service.flight_evaluation.closed_loop import Flown, Outcome
from service.flight_evaluation.evaluation import Evaluation
from service.flight_evaluation.judgement import Tally
from service.flight_evaluation.plan import EvaluationPlan, quick
from service.flight_evaluation.plots import draw, plots_are_possible
from service.flight_evaluation.poses import Manoeuvre, hover, random_pose, trajectory, turn
from service.flight_evaluation.report import report
from service.flight_evaluation.sight import DepthKind
from service.flight_evaluation.survey import Looked
from service.flight_evaluation.tables import print_report
from service.flight_evaluation.worlds import DEFAULT_SCENES, Light, WorldSpec, specs_of
from uavdepth.scenes import SCENE_NAMES

PROMISED = (
    "nearest_error_median",
    "missed_rate",
    "false_rate",
    "scale_error_median",
    "scale_error_p95",
    "bearing_error_p95_deg",
    "approaches",
    "corridors",
)


def picture(tally: Tally | None, scale_error: float | None = 0.02) -> Looked:
    trouble = "bad_scale" if tally is None else None
    points = np.array([[9.0, 10.0]])
    world = WorldSpec("wall", 1100)
    return Looked(world, Manoeuvre.CRUISE, 3.0, tally, trouble, scale_error, points)


def flight(flavor: Flavor, outcome: Outcome) -> Flown:
    return Flown(NORTH, flavor, outcome, 12.0, 4.0, ((0.0, 0.0), (0.1, 0.2)), 0)


@pytest.fixture
def flown() -> Evaluation:
    """Two scenes with figures that can be added up by hand."""
    evaluation = Evaluation(EvaluationPlan(scenes=("wall", "city"), kinds=(DepthKind.TRUE,)))
    wall = evaluation.evidence[DepthKind.TRUE]["wall"]
    wall.looked += [
        picture(Tally(18, 10, 1, 0, 0, 0, np.array([0.1, 0.3]), np.array([0.1]))),
        picture(Tally(18, 10, 0, 2, 3, 0, np.array([0.2]), np.array([0.5]))),
        picture(None, None),
    ]
    wall.bearing_errors_deg += [1.0, 3.0]
    wall.approaches += [flight("ardupilot", Outcome.STOPPED), flight("px4", Outcome.TOUCHED)]
    wall.corridors += [flight("ardupilot", Outcome.PASSED), flight("px4", Outcome.STOPPED)]
    return evaluation


class TestReport:
    def test_every_scene_has_what_was_promised(self, flown: Evaluation) -> None:
        result = report(flown, "a machine", "2026-11-22", "a network")
        assert (result["machine"], result["date"], result["model"]) == (
            "a machine",
            "2026-11-22",
            "a network",
        )
        for figures in (*result["scenes"].values(), result["all"]):
            assert set(PROMISED) <= set(figures)
        assert list(result["scenes"]) == ["wall", "city"]

    def test_rates_are_of_all_pictures_together(self, flown: Evaluation) -> None:
        wall = report(flown, "", "", "")["scenes"]["wall"]
        assert wall["missed_rate"] == pytest.approx(1 / 20)
        assert wall["false_rate"] == pytest.approx(3 / 36)
        assert wall["unknown_rate"] == pytest.approx(2 / 20)
        assert wall["nearest_error_median"] == pytest.approx(0.3)
        assert wall["pictures_not_told"] == 1
        assert wall["troubles"] == {"bad_scale": 1}

    def test_flights_are_counted_by_their_outcome(self, flown: Evaluation) -> None:
        wall = report(flown, "", "", "")["scenes"]["wall"]
        assert wall["approaches"] == {"tried": 2, "stopped": 1, "touched": 1}
        assert wall["approaches_by_autopilot"]["px4"] == {"tried": 1, "stopped": 0, "touched": 1}
        assert wall["corridors"] == {"tried": 2, "passed": 1, "stopped": 1, "touched": 0}

    def test_a_scene_that_was_not_flown_has_no_figures_rather_than_good_ones(self, flown: Evaluation) -> None:
        city = report(flown, "", "", "")["scenes"]["city"]
        assert city["missed_rate"] is None
        assert city["false_rate"] is None
        assert city["approaches"]["tried"] == 0

    def test_it_is_json_even_where_nothing_near_was_told(self, flown: Evaluation) -> None:
        wall = flown.evidence[DepthKind.TRUE]["wall"]
        wall.looked[:] = [picture(Tally(18, 10, 10, 0, 0, 0, np.empty(0), np.array([np.inf])))]
        text = json.dumps(report(flown, "", "", ""), allow_nan=False)
        assert json.loads(text)["scenes"]["wall"]["nearest_error_median"] is None

    def test_no_number_is_cut_where_there_is_little_room(
        self, flown: Evaluation, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setenv("COLUMNS", "60")
        print_report(report(flown, "machine", "date", "model"))
        told = capsys.readouterr().out
        assert "corridors passed" in told
        assert "…" not in told

    def test_plots_are_written(self, flown: Evaluation, tmp_path: Path) -> None:
        if not plots_are_possible():
            pytest.skip("matplotlib is not installed")
        paths = draw(flown, tmp_path / "plots")
        assert sorted(path.name for path in paths) == ["elements_true.png", "flights_true.png"]
        assert all(path.stat().st_size > 5000 for path in paths)


class TestPlan:
    def test_numbers_are_shared_out_without_loss(self) -> None:
        plan = EvaluationPlan()
        assert sum(plan.shared(plan.approaches)) == 20
        assert plan.by_world(4) == (2, 1, 1)

    def test_quick_is_less_of_everything(self) -> None:
        plan = EvaluationPlan()
        less = quick(plan)
        assert less.scenes == plan.scenes
        for name in ("poses", "flights", "approaches", "corridors", "turns", "worlds"):
            assert 0 < getattr(less, name) < getattr(plan, name)

    def test_rounds_are_more_of_everything_open_in_more_worlds(self) -> None:
        plan, more = EvaluationPlan(), EvaluationPlan().repeated(3)
        for name in ("poses", "flights", "turns", "worlds"):
            assert getattr(more, name) == 3 * getattr(plan, name)
        assert (more.approaches, more.corridors) == (plan.approaches, plan.corridors)
        assert len(more.by_world(more.flights)) == 9


class TestWorlds:
    def test_wires_are_for_the_test_alone(self) -> None:
        assert "wires" in DEFAULT_SCENES
        assert "wires" not in SCENE_NAMES

    def test_each_scene_is_flown_in_three_lights_of_seeds_that_no_network_has_seen(self) -> None:
        specs = specs_of("city")
        assert {spec.light for spec in specs} == set(Light)
        assert min(spec.seed for spec in specs) >= 1000

    def test_choices_are_made_in_other_worlds_than_tests(self) -> None:
        for name in DEFAULT_SCENES:
            specs = specs_of(name, validation=True)
            assert {spec.light for spec in specs} == set(Light)
            assert all(900 <= spec.seed < 1000 for spec in specs)

    def test_more_worlds_begin_with_the_same_ones_and_never_reach_those_of_tests(self) -> None:
        specs = specs_of("city", validation=True, count=48)
        assert specs[:3] == specs_of("city", validation=True)
        assert len({spec.seed for spec in specs}) == 48
        assert max(spec.seed for spec in specs) < 1000
        assert [spec.light for spec in specs[3:6]] == list(Light)
        with pytest.raises(ValueError, match="51 validation worlds: there are 50"):
            specs_of("city", validation=True, count=51)

    def test_wires_stand_across_the_way_in_the_height_band(self) -> None:
        scene = WorldSpec("wires", 1100).load()
        heights = np.arange(1.0, 5.5, 0.01)
        origins = np.stack([np.zeros_like(heights) - 55.0, np.full_like(heights, 5.0), -heights], axis=1)
        met = np.isfinite(scene.ray_distance_m(origins, (1.0, 0.0, 0.0)))
        assert 0.005 < met.mean() < 0.9


class TestPoses:
    def test_random_poses_are_free_and_low(self) -> None:
        scene = world_with((10.0, 5.0, 4.0, 4.0, 6.0))
        rng = np.random.default_rng(1)
        for _ in range(10):
            pose = random_pose(scene, rng)
            assert scene.clearance_m(pose.position_ned_m.tolist()) >= 1.0
            assert 1.5 <= -pose.position_ned_m[2] <= 8.0

    def test_a_row_of_flights_holds_every_manoeuvre(self) -> None:
        scene = world_with((10.0, 5.0, 4.0, 4.0, 6.0))
        flights = [trajectory(scene, 1, number, 2.0) for number in range(EvaluationPlan().flights)]
        assert {flight.manoeuvre for flight in flights} == set(Manoeuvre)

    def test_a_turn_reaches_its_rate(self) -> None:
        start = random_pose(world_with(), np.random.default_rng(1))
        flight = turn(start, 90.0, 4.0)
        times = np.arange(0.0, 4.0, 0.01)
        yaw = np.unwrap([flight.pose_at(t).attitude.yaw_rad for t in times])
        assert np.degrees(np.abs(np.diff(yaw)).max() / 0.01) == pytest.approx(90.0, rel=0.02)

    def test_a_hover_stays_where_it_is_and_tells_its_true_velocity(self) -> None:
        start = random_pose(world_with(), np.random.default_rng(1))
        flight = hover(start, np.random.default_rng(2), 4.0)
        for t_s in (0.0, 1.3, 3.9):
            pose, later = flight.pose_at(t_s), flight.pose_at(t_s + 1e-4)
            assert np.linalg.norm(pose.position_ned_m - start.position_ned_m) < 0.3
            moved = (later.position_ned_m - pose.position_ned_m) / 1e-4
            np.testing.assert_allclose(moved, pose.velocity_ned_mps, atol=1e-3)


class TestCommand:
    def test_an_unknown_scene_is_a_wrong_command_line(self, capsys: pytest.CaptureFixture[str]) -> None:
        with pytest.raises(SystemExit) as end:
            main(["evaluate-flight", "--scenes", "moon"])
        assert end.value.code == 2
        assert "'moon'" in capsys.readouterr().err

    def test_a_network_that_is_not_there_is_told_before_anything_is_flown(
        self, capsys: pytest.CaptureFixture[str]
    ) -> None:
        with pytest.raises(SystemExit) as end:
            main(["evaluate-flight", "--model", "nowhere.onnx", "--depth", "network"])
        assert end.value.code == 2
        assert "nowhere.onnx" in capsys.readouterr().err

    def test_it_flies_and_prints_json_alone(self, capsys: pytest.CaptureFixture[str]) -> None:
        words = ["--depth", "true", "--scenes", "wires", "--quick", "--sigma-factor", "1.5"]
        with pytest.raises(SystemExit) as end:
            main(["evaluate-flight", *words, "--approaches", "0", "--corridors", "0", "--json"])
        assert end.value.code == 0
        told = json.loads(capsys.readouterr().out)
        assert (told["sigma_factor"], told["seeds"]) == (1.5, "test")
        wires = told["scenes"]["wires"]
        assert wires["depth"] == "true"
        assert wires["pictures"] > 10
        assert wires["missed_rate"] == 0.0
        assert wires["false_rate"] == 0.0
        assert wires["approaches"]["tried"] == 0
