"""A network that takes the ground as a hint: told what is known early, believed if that proves right."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from hinted_pipeline import (
    AHEAD,
    CAMERA,
    MOUNT,
    MS,
    SECOND,
    HintedDepth,
    ScriptedTelemetry,
    at,
    frame_at,
    perception_of,
)
from program_fakes import FLYING_HEIGHT_M, make_settings

from service.pipeline import Perception
from service.trouble import Trouble
from uavdepth.attitude import Attitude
from uavdepth.model.hints import Hints
from uavdepth.scan.obstacle_scan import ObstacleScan, SectorState
from uavdepth.scan.scanner import ObstacleScanner


def test_metres_come_from_the_network_and_the_height_that_it_is_told() -> None:
    model = HintedDepth()
    result = perception_of(model).step(frame_at(1.0), at(SECOND))
    assert result.trusted
    assert model.told[0] is not None
    assert model.told[0].ground is not None
    assert model.told[0].ground.height_m == FLYING_HEIGHT_M
    assert result.scan.state[AHEAD] == SectorState.OBSTACLE
    assert result.scan.distance_m[AHEAD] == pytest.approx(8.0, rel=0.05)
    assert result.scale is not None
    assert (result.scale.factor, result.scale.age_s, result.scale.sources) == (1.0, 0.0, ("ground",))
    assert result.scale.relative_sigma == pytest.approx(0.05)
    assert result.depth is not None
    assert result.depth.relative_sigma is not None
    assert result.depth.relative_sigma[0, 0] == pytest.approx(math.hypot(0.1, 0.05))


def test_the_state_is_asked_for_before_the_network_runs_and_again_after_it() -> None:
    model = HintedDepth()
    early, late = Attitude(0.01, 0.0, 0.0), Attitude(0.02, 0.0, 0.0)
    telemetry = ScriptedTelemetry(
        model, lambda at_ns: at(at_ns, attitude=early), lambda at_ns: at(at_ns, attitude=late)
    )
    result = perception_of(model).step_late(frame_at(3.0), telemetry)
    assert set(telemetry.asked) == {(3 * SECOND, 0), (3 * SECOND, 1)}
    assert model.told[0] is not None
    assert model.told[0].ground is not None
    assert model.told[0].ground.attitude == early
    assert result.telemetry.attitude == late
    assert result.trusted


def test_an_attitude_that_has_not_arrived_yet_is_carried_on_by_the_turn_so_far() -> None:
    model = HintedDepth()
    arrived_ns = 3 * SECOND - 80 * MS

    def turning(at_ns: int) -> Attitude:
        return Attitude(0.0, (at_ns - 3 * SECOND) / SECOND, 0.0)

    telemetry = ScriptedTelemetry(
        model,
        lambda at_ns: at(at_ns, attitude=turning(at_ns) if at_ns <= arrived_ns else None),
        lambda at_ns: at(at_ns, attitude=turning(at_ns)),
    )
    result = perception_of(model).step_late(frame_at(3.0), telemetry)
    assert result.trusted
    assert len(model.told) == 1
    assert model.told[0] is not None
    assert model.told[0].ground is not None
    # Held instead of carried on it would be 0.1 rad, 5.7 degrees, off.
    assert model.told[0].ground.attitude.pitch_rad == pytest.approx(0.0, abs=1e-3)


@pytest.mark.parametrize(
    ("late", "asked"),
    [
        (Attitude(0.0, math.radians(2.5), 0.0), 1),
        (Attitude(0.0, math.radians(3.5), 0.0), 2),
        (Attitude(math.radians(-3.5), 0.0, 0.0), 2),
        (Attitude(0.0, 0.0, 2.0), 1),
    ],
)
def test_an_answer_to_an_attitude_that_was_not_so_is_asked_for_again(late: Attitude, asked: int) -> None:
    model = HintedDepth()
    telemetry = ScriptedTelemetry(model, at, lambda at_ns: at(at_ns, attitude=late))
    result = perception_of(model).step_late(frame_at(3.0), telemetry)
    assert result.trusted
    assert len(model.told) == asked
    if asked == 2:
        assert model.told[1] is not None
        assert model.told[1].ground is not None
        assert model.told[1].ground.attitude == late


def test_a_small_error_of_the_told_attitude_is_uncertainty() -> None:
    sigmas = []
    for degrees in (0.0, 2.5):
        model, late = HintedDepth(), Attitude(0.0, math.radians(degrees), 0.0)
        telemetry = ScriptedTelemetry(model, at, partial(at, attitude=late))
        result = perception_of(model).step_late(frame_at(3.0), telemetry)
        assert result.scale is not None
        sigmas.append(result.scale.relative_sigma)
    # 2.5 degrees on ground that is seen 15 degrees below the horizon.
    assert sigmas[1] == pytest.approx(math.hypot(sigmas[0], math.radians(2.5) / math.tan(math.radians(15))))


def test_an_attitude_that_comes_only_while_the_network_runs_is_used() -> None:
    model = HintedDepth()
    telemetry = ScriptedTelemetry(model, lambda at_ns: at(at_ns, attitude=None), at)
    result = perception_of(model).step_late(frame_at(3.0), telemetry)
    assert result.trusted
    assert [hints is not None and hints.ground is not None for hints in model.told] == [False, True]


@pytest.mark.parametrize(
    ("changes", "trouble"),
    [
        ({"attitude": None}, Trouble.NO_ATTITUDE),
        ({"height_m": None}, Trouble.NO_HEIGHT),
        ({"height_m": math.nan}, Trouble.NO_GROUND),
        ({"height_m": 0.1}, Trouble.NO_GROUND),
    ],
)
def test_without_attitude_or_height_the_network_runs_unhinted_and_nothing_is_believed(
    changes: dict[str, object], trouble: Trouble
) -> None:
    model = HintedDepth()
    perception = perception_of(model)
    result = perception.step(frame_at(1.0), at(SECOND, **changes))
    assert result.trouble is trouble
    assert np.all(result.scan.state == SectorState.UNKNOWN)
    assert result.depth is None
    assert model.told == [Hints()]


def test_a_height_is_held_for_a_while_moved_by_the_climb_and_then_given_up() -> None:
    model = HintedDepth()
    perception = perception_of(model, "scale.max_age_s=1.0")
    assert perception.step(frame_at(10.0), at(10 * SECOND)).trusted
    blind_ns = 10 * SECOND + 900 * MS
    climbed = at(blind_ns, height_m=None, position_ned_m=(0.0, 0.0, -FLYING_HEIGHT_M - 0.5))
    held = perception.step(frame_at(10.9), climbed)
    assert held.trusted
    assert model.told[1] is not None
    assert model.told[1].ground is not None
    assert model.told[1].ground.height_m == pytest.approx(FLYING_HEIGHT_M + 0.5)
    assert held.scale is not None
    assert held.scale.age_s == pytest.approx(0.9)
    assert held.scale.relative_sigma > 0.05
    late_ns = 11 * SECOND + 100 * MS
    assert perception.step(frame_at(11.1), at(late_ns, height_m=None)).trouble is Trouble.NO_HEIGHT


def test_without_a_rangefinder_the_ekf_tells_the_height_near_the_start_and_no_further() -> None:
    model = HintedDepth()
    perception = perception_of(model, "scale.height_source=both")
    near = perception.step(frame_at(1.0), at(SECOND, height_m=None, position_ned_m=(3.0, 0.0, -10.0)))
    assert near.trusted
    assert near.scale is not None
    assert near.scale.sources == ("ground",)
    assert model.told[-1] is not None
    assert model.told[-1].ground is not None
    assert model.told[-1].ground.height_m == 10.0
    far = perception.step(frame_at(2.0), at(2 * SECOND, height_m=None, position_ned_m=(80.0, 0.0, -10.0)))
    assert far.trouble is Trouble.NO_HEIGHT
    assert model.told[-1] == Hints()


@pytest.mark.parametrize(("rangefinder_m", "removed_m"), [(4.0, 4.0), (None, None)])
def test_ground_is_taken_out_of_the_scan_by_the_rangefinder_alone(
    rangefinder_m: float | None, removed_m: float | None
) -> None:
    """The EKF knows of no hill: what it calls ground may be the top of a house."""
    heights: list[float | None] = []

    class Listening(ObstacleScanner):
        def scan(self, depth_m, attitude, height_m=None, relative_sigma=None) -> ObstacleScan:  # type: ignore[no-untyped-def]
            heights.append(height_m)
            return super().scan(depth_m, attitude, height_m, relative_sigma)

    settings = make_settings("motion.points=false", "scale.height_source=both")
    perception = Perception(settings, HintedDepth(), None, Listening(CAMERA, MOUNT))
    perception.step(frame_at(1.0), at(SECOND, height_m=rangefinder_m, position_ned_m=(0.0, 0.0, -4.0)))
    assert heights == [removed_m]


def test_what_an_autopilot_said_before_it_started_anew_is_forgotten() -> None:
    perception = perception_of(HintedDepth())
    assert perception.step(frame_at(10.0), at(10 * SECOND)).trusted
    blind = at(10 * SECOND + 500 * MS, height_m=None)
    assert perception.step(frame_at(10.5), blind).trusted
    anew = replace(blind, at_ns=10 * SECOND + 600 * MS, epoch=1)
    assert perception.step(frame_at(10.6), anew).trouble is Trouble.NO_HEIGHT


def test_a_height_of_the_future_is_not_held_when_time_steps_back() -> None:
    perception = perception_of(HintedDepth())
    assert perception.step(frame_at(10.0), at(10 * SECOND)).trusted
    assert perception.step(frame_at(9.0), at(9 * SECOND, height_m=None)).trouble is Trouble.NO_HEIGHT


def test_pixels_decide_for_themselves_what_is_unknown() -> None:
    # Doubt that would silence a scale as a whole leaves the sure pixels standing here.
    assert perception_of(HintedDepth(sigma=0.4)).step(frame_at(1.0), at(SECOND)).trusted
    doubtful = perception_of(HintedDepth(sigma=0.6)).step(frame_at(1.0), at(SECOND))
    assert doubtful.trouble is Trouble.NO_DEPTH
    assert np.all(doubtful.scan.state == SectorState.UNKNOWN)
