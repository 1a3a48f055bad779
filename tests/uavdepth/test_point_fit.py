"""A prediction that is off is drawn to points of known depth; without them, and far from them, it stays."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from uavdepth.model.hint_planes import HALF_CONFIDENCE_SIGMA
from uavdepth.model.point_fit import fit_to_points
from uavdepth.model.point_pixels import PointPixels

HEIGHT, WIDTH = 96, 192
TRUE_LOG_Q = np.broadcast_to(np.linspace(-3.5, -1.0, HEIGHT, dtype=np.float32)[:, None], (HEIGHT, WIDTH))


def points_of(
    truth: NDArray[np.float32], row: NDArray[np.intp], column: NDArray[np.intp], sigma: float = 0.03
) -> NDArray[np.float32]:
    """(2, h, w) planes with exact points that call themselves that uncertain."""
    planes = np.zeros((2, *truth.shape), np.float32)
    planes[0, row, column] = np.exp(truth[row, column])
    planes[1, row, column] = 1.0 / (1.0 + (sigma / HALF_CONFIDENCE_SIGMA) ** 2)
    return planes


def fit(
    predicted: NDArray[np.float32], planes: NDArray[np.float32], sigma: float = 0.5
) -> NDArray[np.float32]:
    """The fit of a network that is that sure of itself everywhere."""
    return fit_to_points(
        predicted, np.full(predicted.shape, sigma, np.float32), PointPixels.of_planes(planes)
    )


def scattered(count: int, seed: int = 0) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    rng = np.random.default_rng(seed)
    return rng.integers(0, HEIGHT, count), rng.integers(0, WIDTH, count)


def test_without_points_the_prediction_stays() -> None:
    nothing = np.zeros((2, HEIGHT, WIDTH), np.float32)
    np.testing.assert_array_equal(fit(TRUE_LOG_Q, nothing), TRUE_LOG_Q)


@pytest.mark.parametrize("factor", [0.6, 0.9, 1.5])
def test_a_wrong_scale_is_mended_everywhere(factor: float) -> None:
    predicted = TRUE_LOG_Q + np.float32(np.log(factor))
    fitted = fit(predicted, points_of(TRUE_LOG_Q, *scattered(100)))
    assert np.abs(fitted - TRUE_LOG_Q).max() < 0.15 * abs(np.log(factor))


def test_an_error_that_changes_across_the_picture_is_mended() -> None:
    predicted = TRUE_LOG_Q + np.linspace(-0.3, 0.3, WIDTH, dtype=np.float32)
    fitted = fit(predicted, points_of(TRUE_LOG_Q, *scattered(150)))
    assert np.mean(np.abs(fitted - TRUE_LOG_Q)) < 0.25 * np.mean(np.abs(predicted - TRUE_LOG_Q))


def test_what_stands_before_a_background_keeps_its_outline() -> None:
    truth = np.full((HEIGHT, WIDTH), -3.0, np.float32)
    truth[30:70, 80:120] = -1.2
    predicted = truth.copy()
    predicted[30:70, 80:120] += 0.4
    row, column = scattered(200)
    fitted = fit(predicted, points_of(truth, row, column))
    assert np.abs(fitted - truth)[30:70, 80:120].max() < 0.08
    outside = np.ones(truth.shape, bool)
    outside[30:70, 80:120] = False
    assert np.abs(fitted - truth)[outside].max() < 0.03


def test_far_from_every_point_the_prediction_stays() -> None:
    predicted = TRUE_LOG_Q + np.float32(0.3)
    row, column = scattered(50)
    fitted = fit(predicted, points_of(TRUE_LOG_Q, row, column // 16))
    assert np.abs(fitted[:, -24:] - predicted[:, -24:]).max() < 1e-3
    assert np.abs(fitted[:, :12] - TRUE_LOG_Q[:, :12]).max() < 0.06


def test_one_wrong_point_among_many_right_ones_moves_little() -> None:
    row, column = scattered(120)
    truth = TRUE_LOG_Q.copy()
    truth[row[0], column[0]] += 1.5
    fitted = fit(TRUE_LOG_Q, points_of(truth, row, column), sigma=0.15)
    assert np.abs(fitted - TRUE_LOG_Q).max() < 0.1
    assert np.mean(np.abs(fitted - TRUE_LOG_Q)) < 0.02


def test_points_that_are_not_sure_change_little() -> None:
    predicted = TRUE_LOG_Q + np.float32(0.3)
    row, column = np.array([48]), np.array([96])
    sure = fit(predicted, points_of(TRUE_LOG_Q, row, column, 0.02))
    unsure = fit(predicted, points_of(TRUE_LOG_Q, row, column, 0.5))
    assert abs(sure[48, 96] - TRUE_LOG_Q[48, 96]) < 0.05
    assert abs(unsure[48, 96] - predicted[48, 96]) < 0.06


@pytest.mark.parametrize("count", [30, 300])
def test_an_error_that_unsure_points_share_does_not_become_the_pictures(count: int) -> None:
    """A velocity that is 12 % off puts all of them 12 % off, however many they are."""
    planes = points_of(TRUE_LOG_Q + np.float32(0.12), *scattered(count), 0.12)
    moved = fit(TRUE_LOG_Q, planes, sigma=0.15)
    assert np.abs(moved - TRUE_LOG_Q).max() < 0.35 * 0.12


def test_a_network_that_is_sure_gives_way_less() -> None:
    predicted = TRUE_LOG_Q + np.float32(0.1)
    planes = points_of(TRUE_LOG_Q, *scattered(60))
    left = [float(np.abs(fit(predicted, planes, sigma) - TRUE_LOG_Q).mean()) for sigma in (0.03, 0.1, 0.4)]
    assert left[2] < 0.02 < left[1] < 0.05 < left[0] < 0.1


@pytest.mark.parametrize("unknown", [np.nan, np.inf])
def test_unknown_doubt_is_doubt(unknown: float) -> None:
    predicted = TRUE_LOG_Q + np.float32(0.3)
    planes = points_of(TRUE_LOG_Q, *scattered(100))
    np.testing.assert_allclose(fit(predicted, planes, unknown), fit(predicted, planes, 1.0))


def test_what_is_not_finite_stays_so_and_spoils_nothing_else() -> None:
    predicted = TRUE_LOG_Q + np.float32(0.3)
    predicted[:8] = np.nan
    predicted[8:10, :5] = -np.inf
    predicted[8:10, 5:10] = np.inf
    row, column = scattered(100)
    fitted = fit(predicted, points_of(TRUE_LOG_Q, row, column))
    np.testing.assert_array_equal(np.isnan(fitted), np.isnan(predicted))
    np.testing.assert_array_equal(np.isinf(fitted), np.isinf(predicted))
    assert np.abs(fitted[12:] - TRUE_LOG_Q[12:]).max() < 0.05


def test_a_prediction_that_spans_more_than_any_scene_is_fitted_where_its_points_are() -> None:
    predicted = np.linspace(-40, 40, HEIGHT * WIDTH, dtype=np.float32).reshape(HEIGHT, WIDTH)
    row, column = scattered(50)
    fitted = fit(predicted, points_of(predicted.clip(-8, 8), row, column))
    assert np.isfinite(fitted).all()
