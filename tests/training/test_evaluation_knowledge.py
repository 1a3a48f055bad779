"""What the vehicle knows in an evaluation: as wrong as in flight, the same every time, and never scored."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from frames import HEIGHT, WIDTH, ground_frame

from training.errors import EvaluationError
from training.evaluation_frames import EvaluationFrame
from training.evaluation_knowledge import (
    HEIGHT_SIGMA,
    TILT_SIGMA_RAD,
    HintMode,
    Knowledge,
    hint_modes,
    points_ratio,
    vehicle_knowledge,
)
from uavdepth.model.hint_planes import MOST_POINTS
from uavdepth.model.hints import Hints, PointHints


def textured(index: int = 0, height_m: float | None = 3.0) -> EvaluationFrame:
    """Flat ground under a picture full of corners."""
    frame = replace(ground_frame(3.0, -0.3), height_m=height_m)
    rng = np.random.default_rng(1)
    blocks = rng.integers(0, 255, (HEIGHT // 4, WIDTH // 4, 3)).astype(np.uint8)
    return EvaluationFrame("city", 1000, index, replace(frame, image_bgr=blocks.repeat(4, 0).repeat(4, 1)))


def test_the_same_frame_is_known_in_the_same_way_every_time() -> None:
    first, second = (vehicle_knowledge(textured(), (20, 100)) for _ in range(2))
    assert first.attitude == second.attitude
    assert first.height_m == second.height_m
    for count in (20, 100):
        assert np.array_equal(first.points[count].pixels, second.points[count].pixels)
        assert np.array_equal(first.points[count].depth_m, second.points[count].depth_m)


def test_another_frame_of_the_same_world_has_other_errors() -> None:
    first, second = (vehicle_knowledge(textured(index), (20,)) for index in (0, 1))
    assert first.attitude != second.attitude
    assert first.height_m != second.height_m


def test_more_points_leave_the_other_errors_alone() -> None:
    few, many = (vehicle_knowledge(textured(), counts) for counts in ((20,), (20, 200)))
    assert few.attitude == many.attitude
    assert np.array_equal(few.points[20].depth_m, many.points[20].depth_m)


def test_attitude_and_height_are_as_wrong_as_a_vehicles() -> None:
    truth = textured().frame.attitude
    known = [vehicle_knowledge(textured(index), ()) for index in range(400)]
    tilts = [item.attitude.roll_rad - truth.roll_rad for item in known]
    tilts += [item.attitude.pitch_rad - truth.pitch_rad for item in known]
    assert np.std(tilts) == pytest.approx(TILT_SIGMA_RAD, rel=0.1)
    assert math.degrees(TILT_SIGMA_RAD) == pytest.approx(0.5)
    heights = [item.height_m / 3.0 - 1.0 for item in known if item.height_m is not None]
    assert len(heights) == len(known)
    assert np.std(heights) == pytest.approx(HEIGHT_SIGMA, rel=0.1)
    assert all(item.attitude.yaw_rad == truth.yaw_rad for item in known)


@pytest.mark.parametrize("height_m", [None, 0.1])
def test_a_vehicle_without_a_height_has_no_ground_hint(height_m: float | None) -> None:
    known = vehicle_knowledge(textured(height_m=height_m), ())
    assert known.height_m is None
    assert known.hints(HintMode(ground=True)) == Hints()


def test_a_mode_gives_what_it_names_and_nothing_else() -> None:
    known = vehicle_knowledge(textured(), (20,))
    assert known.hints(HintMode()) == Hints()
    ground = known.hints(HintMode(ground=True))
    assert ground.ground is not None
    assert ground.points is None
    both = known.hints(HintMode(True, 20))
    assert both.ground == ground.ground
    assert both.points is known.points[20]


def test_points_that_were_told_are_not_scored() -> None:
    item = textured()
    known = vehicle_knowledge(item, (20, 100))
    scored = known.without_points(item.frame.depth_m)
    told = np.isnan(scored)
    for points in known.points.values():
        column, row = np.rint(points.pixels).astype(int).T
        assert told[row, column].all()
    assert 0 < np.count_nonzero(told) <= 120
    assert np.array_equal(scored[~told], item.frame.depth_m[~told])
    assert not np.isnan(item.frame.depth_m).any(), "the frame itself stays as it is"


def test_a_network_is_measured_with_what_it_takes() -> None:
    assert [mode.label for mode in hint_modes((), (100,))] == ["none"]
    assert [mode.label for mode in hint_modes(("ground",), (100,))] == ["none", "ground"]
    assert [mode.label for mode in hint_modes(("points",), (20, 100))] == ["none", "20 points", "100 points"]
    assert [mode.label for mode in hint_modes(("ground", "points"), (20, 100))] == [
        "none",
        "ground",
        "ground+20 points",
        "ground+100 points",
    ]


@pytest.mark.parametrize("counts", [(0,), (MOST_POINTS + 1,), (20, 20)])
def test_counts_of_points_that_no_network_takes_are_refused(counts: tuple[int, ...]) -> None:
    with pytest.raises(EvaluationError, match="points"):
        hint_modes(("points",), counts)


def test_the_points_tell_the_scale_of_a_network_without_one() -> None:
    item = textured()
    depth_m = item.frame.depth_m
    pixels = np.array([[20.0, 80.0], [80.0, 85.0], [140.0, 90.0], [80.0, 0.0]])
    there = depth_m[pixels[:, 1].astype(int), pixels[:, 0].astype(int)]
    known = np.where(np.isfinite(there), there, 5.0)
    points = PointHints(pixels, known * np.array([1.0, 1.02, 0.98, 1.0]), np.full(4, 0.05))
    camera = item.frame.camera
    assert points_ratio(points, camera, depth_m * np.float32(0.25)) == pytest.approx(4.0, rel=1e-4)
    assert points_ratio(points, camera, np.full_like(depth_m, np.nan)) is None


def test_knowledge_without_points_scores_everything() -> None:
    frame = textured().frame
    known = Knowledge(frame.camera, frame.mount, frame.attitude, 3.0)
    assert np.array_equal(known.without_points(frame.depth_m), frame.depth_m)
