"""`uavdepth evaluate-motion`: what it measures, on journeys small enough to know the answer."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest

from service.errors import ConfigError, RecordError
from service.motion_evaluation import command
from service.motion_evaluation.depth_errors import abs_rel, log_scale
from service.motion_evaluation.erring_autopilot import ErringAutopilot
from service.motion_evaluation.evaluation import Errors, evaluate_journey
from service.motion_evaluation.journey import Moment, Said
from service.motion_evaluation.point_errors import PointErrors
from service.motion_evaluation.scale_errors import ScaleErrors
from service.motion_evaluation.summary import GroupSummary, targets
from service.motion_evaluation.unitless import UNIT_M, UnitlessTruth
from uavdepth import Attitude, CameraModel, CameraMount, GroundHint, PointHints
from uavdepth.scale.estimator import ScaleEstimate

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "uavdepth"))
from moving_camera import LEVEL, wall_picture

WALL_M = 14.0


@dataclass(frozen=True)
class WallJourney:
    """Sideways past a painted wall at 3 m/s, with an exact autopilot."""

    name: str = "wall"
    group: str = "flight"
    camera: CameraModel = field(default_factory=lambda: CameraModel.from_fov(320, 160, 80))
    mount: CameraMount = field(default_factory=CameraMount)
    hidden: bool = False
    pictures: int = 36

    def moments(self) -> Iterator[Moment]:
        for number in range(self.pictures):
            position, velocity = (0.0, 0.3 * number, 0.0), (0.0, 3.0, 0.0)
            at_ns = number * 100_000_000
            said = Said(at_ns, LEVEL, np.array(position), np.array(velocity))
            truth = None if self.hidden else np.full((160, 320), WALL_M, np.float32)
            image = wall_picture(self.camera, position, WALL_M)
            yield Moment(at_ns, image, truth, (said,), GroundHint(self.mount, LEVEL, 5.0), 3.0)


@pytest.fixture(scope="module")
def errors_past_a_wall() -> Errors:
    return evaluate_journey(WallJourney(), None)


@pytest.fixture(scope="module")
def past_a_wall(errors_past_a_wall: Errors) -> GroupSummary:
    return GroupSummary.of(errors_past_a_wall)


@pytest.fixture
def planned(monkeypatch: pytest.MonkeyPatch, errors_past_a_wall: Errors) -> None:
    """A command that plans the wall alone and has been there already."""
    monkeypatch.setattr("service.motion_evaluation.plan.planned_journeys", lambda *_: [WallJourney()])
    monkeypatch.setattr(
        "service.motion_evaluation.evaluation.evaluate_journey", lambda *_: errors_past_a_wall
    )


def test_points_on_a_wall_are_measured_against_it(past_a_wall: GroupSummary) -> None:
    points = past_a_wall.points
    assert points is not None
    assert points.count > 1000
    assert points.median < 0.03


def test_the_estimator_is_measured_with_depth_that_has_no_metres(past_a_wall: GroupSummary) -> None:
    scale = past_a_wall.scales["truth relative, points"]
    assert scale is not None
    assert scale.trusted == 1.0
    assert scale.median < 0.06
    assert scale.converged_s is not None
    assert scale.converged_s < 1.0
    # A wall without ground: what the rangefinder says finds nothing to lie on.
    by_ground = past_a_wall.scales["truth relative, ground"]
    assert by_ground is not None
    assert by_ground.trusted == 0.0
    assert math.isnan(by_ground.median)


def test_a_target_that_nothing_was_measured_for_is_missed(past_a_wall: GroupSummary) -> None:
    unseen = GroupSummary.of(evaluate_journey(WallJourney(hidden=True, pictures=2), None))
    found, missed = (targets({"flight": group})[0] for group in (past_a_wall, unseen))
    assert found.what == missed.what == "flight: points, median error <= 0.05"
    assert found.met
    assert missed.found is None
    assert not missed.met


def test_points_at_one_depth_do_not_tell_scale_and_shift(past_a_wall: GroupSummary) -> None:
    by_points = past_a_wall.scales["truth affine, points"]
    assert by_points is not None
    assert by_points.trusted == 0.0


def test_without_any_truth_held_out_points_stand_for_it() -> None:
    errors = evaluate_journey(WallJourney(group="kitti odometry", hidden=True, pictures=8), None)
    assert errors.points.summary() is None
    assert errors.scales == {}


def test_errors_of_points_and_their_sigma() -> None:
    truth = np.full((50, 100), 10.0, np.float32)
    truth[:, 60:] = 50.0
    points = PointHints(
        [[10, 10], [20, 10], [30, 10], [40, 10], [80, 10]], [10.1, 9.7, 10.2, 13.0, 70.0], np.full(5, 0.025)
    )
    errors = PointErrors()
    errors.add(points, truth)
    found = errors.summary()
    assert found is not None
    assert found.count == 4, "the one at 50 m is beyond what is asked for"
    assert found.per_picture == 5
    assert found.median == pytest.approx(0.025, abs=0.001)
    assert found.within_sigma == 0.5
    assert found.within_two_sigma == 0.75


def test_lidar_around_a_point_counts_where_it_lies_on_one_surface() -> None:
    truth = np.full((20, 20), np.nan, np.float32)
    truth[4, 5], truth[6, 5] = 10.0, 10.4
    truth[14, 5], truth[16, 5] = 10.0, 20.0
    errors = PointErrors()
    errors.add(PointHints([[5, 5], [5, 15], [15, 15]], [10.0, 10.0, 10.0], np.full(3, 0.1)), truth)
    found = errors.summary()
    assert found is not None
    assert found.count == 1


def test_abs_rel_scales_nothing() -> None:
    truth = np.full((30, 30), 10.0, np.float32)
    truth[:5] = np.inf
    assert abs_rel(np.full((30, 30), 12.0, np.float32), truth) == pytest.approx(0.2)
    assert log_scale(np.full((30, 30), 12.0, np.float32), truth) == pytest.approx(math.log(1.2), abs=1e-6)
    assert math.isnan(abs_rel(truth, np.full((30, 30), np.nan, np.float32)))


def test_a_scale_counts_from_three_seconds_of_motion_on_and_only_where_it_is_trusted() -> None:
    errors = ScaleErrors()
    for number in range(80):
        wrong = 0.5 if number < 15 else 0.02
        doubtful = number % 10 == 0
        estimate = ScaleEstimate(1.0, 0.0, 0.4 if doubtful else 0.05, ("points",), 0.0)
        speed = 0.5 if number < 10 else 2.0
        errors.add(estimate, math.log(1.9 if doubtful else 1 + wrong), 0.1, speed, 0.1)
    errors.close()
    found = errors.summary()
    assert found is not None
    assert found.pictures == 41
    assert found.trusted == pytest.approx(36 / 41, abs=0.03)
    assert found.median == pytest.approx(0.02)
    assert found.within_two_sigma == 1.0
    assert found.early_p95 == pytest.approx(0.5)


def test_when_a_scale_has_settled() -> None:
    errors = ScaleErrors()
    for number in range(60):
        estimate = ScaleEstimate(1.0, 0.0, 0.05, ("points",), 0.0)
        errors.add(estimate, 0.4 if number < 12 else 0.05, 0.1, 2.0, 0.1)
    errors.close()
    found = errors.summary()
    assert found is not None
    assert found.converged_s == pytest.approx(1.3, abs=0.11)


def test_unitless_truth_has_another_unit_and_errs_in_whole_regions() -> None:
    truth = np.full((80, 160), 10.0, np.float32)
    depth = UnitlessTruth("relative").of(truth, 0.0).depth_m
    ratio = np.log(depth * UNIT_M / truth)
    assert abs(np.median(ratio)) < 0.1
    assert 0.03 < ratio.std() < 0.2
    assert np.abs(np.diff(ratio, axis=1)).max() < 0.05, "neighbours err alike"
    affine = UnitlessTruth("affine").of(truth, 0.0)
    assert affine.affine_inverse_depth is not None
    assert np.isnan(affine.depth_m).all()


def test_the_autopilot_errs_slowly_and_freshly() -> None:
    pytest.importorskip("embreex", reason="rendered worlds need the extra sim")
    from uavdepth.scenes.flight import Pose

    def still(t_s: float) -> Pose:
        return Pose(np.array([t_s, 0.0, -5.0]), np.array([1.0, 0.0, 0.0]), Attitude(0.0, 0.0, 0.0))

    said = ErringAutopilot(still, 0.0, 3).until(4.0)
    velocities = np.array([each.velocity_ned_mps for each in said if each.velocity_ned_mps is not None])
    assert len(velocities) == 61
    assert 0.03 < velocities.std(axis=0).mean() < 0.15
    assert [each.at_ns for each in said] == sorted(each.at_ns for each in said)


def test_a_recorded_flight_s_true_path_is_read_and_the_autopilot_knew_it_well() -> None:
    pytest.importorskip("embreex", reason="rendered worlds need the extra sim")
    from service.motion_evaluation.recorded_journey import read_recording

    log = Path(__file__).resolve().parents[2] / "sitl_logs" / "C_s_turns.BIN"
    recording = read_recording(log)
    told = [each for each in recording.said if each.velocity_ned_mps is not None]
    off = [
        np.abs(recording.pose(each.at_ns * 1e-9).velocity_ned_mps - each.velocity_ned_mps).max()
        for each in told[::40]
        if each.velocity_ned_mps is not None
    ]
    assert len(off) > 50
    assert np.median(off) < 0.15
    hovering = recording.pose(float(recording.attitudes[0, 0]) + 85.0)
    assert hovering.position_ned_m[2] == pytest.approx(-11.0, abs=0.2), "it yaws on the spot there"
    assert abs(hovering.attitude.roll_rad) < math.radians(3)


def test_what_is_not_there_is_named(tmp_path: Path) -> None:
    from service.motion_evaluation.kitti_journey import open_kitti
    from service.motion_evaluation.recorded_journey import read_recording

    with pytest.raises(RecordError, match=r"no recorded flight at .*X\.BIN"):
        read_recording(tmp_path / "X.BIN")
    with pytest.raises(RecordError, match=str(tmp_path)):
        open_kitti(tmp_path)
    with pytest.raises(ConfigError, match="--flights, --log FILE or --kitti FOLDER"):
        command.evaluate_motion(flights=False, recorded=False)


@pytest.mark.usefixtures("planned")
def test_the_command_prints_one_json_object(capsys: pytest.CaptureFixture[str]) -> None:
    command.evaluate_motion(model="none", as_json=True)
    found = json.loads(capsys.readouterr().out)
    assert found["model"] is None
    assert found["machine"]
    assert found["groups"]["flight"]["points"]["median"] < 0.03
    assert found["groups"]["flight"]["scales"]["truth relative, ground"]["median"] is None
    assert found["journeys"].keys() == {"wall"}
    assert {"what", "found", "met"} == found["targets"][0].keys()


@pytest.mark.usefixtures("planned")
def test_the_command_prints_tables(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(command.typer.Exit):
        command.evaluate_motion(model="none", strict=True)
    table = capsys.readouterr().out
    assert "truth relative, both" in table
    assert "missed" in table
