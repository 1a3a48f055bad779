"""The seven errors, against values worked out by hand, and the two answers that cost nothing."""

from __future__ import annotations

import math

import numpy as np
import pytest
from frames import ground_frame
from hypothesis import given
from hypothesis import strategies as st

from training.baselines import (
    TRAINING_MEDIAN_DEPTH_M,
    constant_depth,
    flat_ground_depth,
    nearest_point_depth,
)
from training.metrics import DEPTH_CAP_M, MIN_PIXELS, DepthMetrics, depth_metrics, median_factor
from uavdepth.attitude import Attitude
from uavdepth.camera import CameraModel, CameraMount
from uavdepth.model.hints import PointHints


def filled(*values: float) -> np.ndarray[tuple[int, ...], np.dtype[np.float32]]:
    """A map in which each value has the same number of pixels."""
    return np.repeat(np.array(values, np.float32), MIN_PIXELS)[None]


def test_the_errors_are_those_worked_out_by_hand() -> None:
    # d = 2, 4, 10; p = 3, 4, 8.
    found = depth_metrics(filled(2.0, 4.0, 10.0), filled(3.0, 4.0, 8.0))
    assert found is not None
    assert found.abs_rel == pytest.approx((0.5 + 0.0 + 0.2) / 3)
    assert found.sq_rel == pytest.approx((0.5 + 0.0 + 0.4) / 3)
    assert found.rmse == pytest.approx(math.sqrt((1.0 + 0.0 + 4.0) / 3))
    assert found.rmse_log == pytest.approx(math.sqrt((math.log(1.5) ** 2 + math.log(0.8) ** 2) / 3))
    # Ratios 1.5, 1 and 1.25: 1.25 itself is not below 1.25, 1.5 is below 1.5625.
    assert found.below_125_2 == found.below_125_3 == 1.0
    assert found.below_125 <= 2 / 3


def test_the_truth_has_no_errors() -> None:
    truth = filled(1.0, 7.0, 60.0)
    assert depth_metrics(truth, truth) == DepthMetrics(0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0)


@given(st.floats(0.2, 5.0))
def test_a_wrong_scale_alone_is_mended_by_the_median(factor: float) -> None:
    truth = filled(2.0, 4.0, 10.0)
    predicted = truth * np.float32(factor)
    found = median_factor(truth, predicted)
    assert found is not None
    assert found == pytest.approx(1.0 / factor, rel=1e-5)
    mended = depth_metrics(truth, predicted, found)
    assert mended is not None
    assert mended.abs_rel == pytest.approx(0.0, abs=1e-5)


@given(st.integers(0, 1000), st.floats(0.05, 20.0))
def test_median_scaled_errors_do_not_depend_on_the_networks_unit(seed: int, unit: float) -> None:
    rng = np.random.default_rng(seed)
    truth = rng.uniform(1.0, 60.0, (16, 16)).astype(np.float32)
    predicted = (truth * np.exp(rng.normal(0.0, 0.3, truth.shape))).astype(np.float32)
    errors = []
    for answer in (predicted, predicted * np.float32(unit)):
        factor = median_factor(truth, answer)
        assert factor is not None
        found = depth_metrics(truth, answer, factor)
        assert found is not None
        errors.append(found.as_dict())
    assert errors[0] == pytest.approx(errors[1], rel=1e-3, abs=1e-3)


@given(st.integers(0, 1000))
def test_the_shares_below_a_ratio_grow_with_the_ratio(seed: int) -> None:
    rng = np.random.default_rng(seed)
    truth = rng.uniform(0.1, 79.0, (16, 16)).astype(np.float32)
    found = depth_metrics(truth, rng.uniform(0.1, 200.0, truth.shape).astype(np.float32))
    assert found is not None
    assert 0.0 <= found.below_125 <= found.below_125_2 <= found.below_125_3 <= 1.0
    assert found.abs_rel >= 0.0


@pytest.mark.parametrize("nothing", [0.0, -1.0, np.nan, np.inf])
def test_sky_zeros_and_missing_truth_are_not_measured(nothing: float) -> None:
    assert depth_metrics(filled(5.0, nothing), filled(6.0, 1.0)) == depth_metrics(filled(5.0), filled(6.0))


def test_sky_and_whatever_is_beyond_the_cap_is_not_measured() -> None:
    near = depth_metrics(filled(5.0), filled(6.0))
    with_sky = depth_metrics(filled(5.0, np.inf, DEPTH_CAP_M + 1), filled(6.0, 1.0, 1.0))
    assert near == with_sky


def test_a_prediction_of_nothing_there_counts_as_the_cap() -> None:
    found = depth_metrics(filled(40.0), filled(np.inf))
    assert found is not None
    assert found.abs_rel == pytest.approx((DEPTH_CAP_M - 40.0) / 40.0)


def test_unknown_depth_is_left_out() -> None:
    assert depth_metrics(filled(5.0, 5.0), filled(np.nan, 5.0)) == depth_metrics(filled(5.0), filled(5.0))


def test_a_picture_almost_all_of_sky_says_nothing() -> None:
    truth = np.full((20, 20), np.inf, np.float32)
    truth.flat[: MIN_PIXELS - 1] = 4.0
    assert depth_metrics(truth, np.ones_like(truth)) is None
    assert median_factor(truth, np.ones_like(truth)) is None


@pytest.mark.parametrize("middle", [0.0, np.inf])
def test_no_factor_mends_a_prediction_without_a_finite_median(middle: float) -> None:
    assert median_factor(filled(5.0), filled(middle)) is None


def test_every_picture_counts_alike_in_the_mean() -> None:
    first, second = DepthMetrics(0.25, 1, 1, 1, 0, 0, 0), DepthMetrics(0.75, 3, 3, 3, 1, 1, 1)
    assert DepthMetrics.mean([first, second]) == DepthMetrics(0.5, 2, 2, 2, 0.5, 0.5, 0.5)
    assert DepthMetrics.mean([]) is None


def test_flat_ground_is_exact_where_the_world_is_flat_ground() -> None:
    frame = ground_frame(height_m=3.0, pitch_rad=-0.2)
    answer = flat_ground_depth(frame.camera, frame.mount, frame.attitude, 3.0)
    ground = frame.depth_m < DEPTH_CAP_M
    assert np.allclose(answer[ground], frame.depth_m[ground], rtol=1e-5)
    assert np.all(answer[~np.isfinite(frame.depth_m)] == DEPTH_CAP_M)


def test_flat_ground_knows_where_the_camera_sits_and_how_the_vehicle_rolls() -> None:
    camera = CameraModel.from_fov(64, 32, 80.0)
    high = flat_ground_depth(camera, CameraMount(down_m=-1.0), Attitude(0.0, -0.3, 0.0), 2.0)
    low = flat_ground_depth(camera, CameraMount(), Attitude(0.0, -0.3, 0.0), 2.0)
    assert np.nanmedian(high[-1] / low[-1]) > 1.3
    rolled = flat_ground_depth(camera, CameraMount(), Attitude(math.radians(20), -0.3, 0.0), 2.0)
    assert rolled[-1, -1] < rolled[-1, 0]


def test_constant_depth_never_looks() -> None:
    answer = constant_depth(CameraModel.from_fov(64, 32, 80.0))
    assert answer.shape == (32, 64)
    assert np.unique(answer) == pytest.approx([TRAINING_MEDIAN_DEPTH_M])


def test_the_nearest_point_fills_the_picture_around_it() -> None:
    camera = CameraModel.from_fov(64, 32, 80.0)
    points = PointHints(np.array([[5.0, 16.0], [60.0, 16.0]]), np.array([2.0, 9.0]), np.full(2, 0.05))
    answer = nearest_point_depth(camera, points)
    assert np.all(answer[:, :20] == 2.0)
    assert np.all(answer[:, 50:] == 9.0)
    assert set(np.unique(answer)) == {2.0, 9.0}


def test_without_any_point_the_depth_is_the_constant_one() -> None:
    camera = CameraModel.from_fov(64, 32, 80.0)
    nothing = PointHints(np.empty((0, 2)), np.empty(0), np.empty(0))
    assert np.array_equal(nearest_point_depth(camera, nothing), constant_depth(camera))
