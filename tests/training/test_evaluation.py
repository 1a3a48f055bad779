"""Evaluation of a frame: every hint beside the baselines, nothing left out."""

from __future__ import annotations

from dataclasses import replace
from typing import cast

import numpy as np
import pytest
from frames import WIDTH, ground_frame
from knowing_network import KnowingNetwork

from training.evaluation import MeasuredFrame, measure_frame
from training.evaluation_frames import EvaluationFrame
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
from uavdepth.errors import ImageSizeError
from uavdepth.model.depth_model import DepthModel


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


def test_a_camera_that_does_not_fit_its_picture_stops_the_measuring() -> None:
    with pytest.raises(ImageSizeError, match="10x10"):
        DepthModel.load("default", "cpu", 1).infer(np.zeros((10, 10, 3), np.uint8), ground_frame().camera)


def test_the_sheets_row_shows_what_the_network_said_with_all_its_hints() -> None:
    frame = ground_frame(3.0, -0.3)
    network = KnowingNetwork(
        frame.depth_m, hints=("ground", "points"), relative_error={0: -0.4, 1: -0.2, 2: 0.0}
    )
    row = measured(network).row
    assert row.caption.startswith("city:1000 #0   ground+100 points: Abs Rel 0.000 as given")
    ground = frame.depth_m < 80
    assert np.allclose(row.predicted_m[ground], frame.depth_m[ground], rtol=1e-4)
