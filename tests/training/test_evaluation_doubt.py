"""Sigma against errors that are drawn from a known distribution."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from training.evaluation_doubt import (
    LAPLACE_COVERAGE,
    NOMINAL_COVERAGE,
    SIGMAS,
    DoubtErrors,
    doubt_errors,
    pooled,
    spearman,
)
from training.metrics import DEPTH_CAP_M, MIN_PIXELS

SHAPE = (300, 400)
TRUTH_M = np.full(SHAPE, 10.0, np.float32)


def measured(log_error: NDArray[np.float64], sigma: NDArray[np.float64] | float) -> DoubtErrors:
    predicted = (TRUTH_M * np.exp(log_error)).astype(np.float32)
    found = doubt_errors(TRUTH_M, predicted, np.broadcast_to(np.float32(sigma), SHAPE))
    assert found is not None
    return found


def test_an_honest_gaussian_sigma_covers_what_gauss_says() -> None:
    rng = np.random.default_rng(1)
    sigma = np.exp(rng.uniform(math.log(0.02), math.log(0.3), SHAPE))
    found = measured(sigma * rng.standard_normal(SHAPE), sigma)
    assert found.coverage == pytest.approx(NOMINAL_COVERAGE, abs=0.005)
    assert found.within_one_sigma == pytest.approx(0.683, abs=0.005)


def test_an_honest_laplace_sigma_covers_more_within_one_sigma() -> None:
    rng = np.random.default_rng(2)
    # A Laplace distribution of scale b has the standard deviation b * sqrt(2).
    found = measured(rng.laplace(0.0, 0.1 / math.sqrt(2.0), SHAPE), 0.1)
    assert found.coverage == pytest.approx(LAPLACE_COVERAGE, abs=0.005)
    assert found.within_one_sigma == pytest.approx(0.757, abs=0.005)


@pytest.mark.parametrize("boast", [0.5, 2.0])
def test_a_sigma_that_is_wrong_by_a_factor_shows_in_the_coverage(boast: float) -> None:
    rng = np.random.default_rng(3)
    found = measured(0.1 * rng.standard_normal(SHAPE), 0.1 * boast)
    expected = [math.erf(limit * boast / math.sqrt(2.0)) for limit in SIGMAS]
    assert found.coverage == pytest.approx(expected, abs=0.005)


def test_a_sigma_that_knows_where_the_errors_are_makes_the_surest_half_better() -> None:
    rng = np.random.default_rng(4)
    sigma = np.where(rng.random(SHAPE) < 0.5, 0.02, 0.2)
    found = measured(sigma * rng.standard_normal(SHAPE), sigma)
    # Mean of |x| for a Gaussian is sigma * sqrt(2 / pi); relative error is log error to first order.
    gauss = math.sqrt(2.0 / math.pi)
    assert found.surest_abs_rel == pytest.approx(0.02 * gauss, rel=0.05)
    assert found.all_abs_rel == pytest.approx(0.11 * gauss, rel=0.05)
    assert found.rank_correlation > 0.5


def test_a_sigma_that_knows_nothing_leaves_the_surest_half_as_bad_as_all() -> None:
    rng = np.random.default_rng(5)
    found = measured(0.1 * rng.standard_normal(SHAPE), np.exp(rng.normal(-2.0, 0.5, SHAPE)))
    assert found.surest_abs_rel == pytest.approx(found.all_abs_rel, rel=0.03)
    assert found.rank_correlation == pytest.approx(0.0, abs=0.05)


def test_a_sigma_that_never_changes_has_no_rank_correlation() -> None:
    rng = np.random.default_rng(6)
    assert measured(0.1 * rng.standard_normal(SHAPE), 0.1).rank_correlation == 0.0


def test_pooling_sees_that_a_hard_picture_is_known_to_be_hard() -> None:
    rng = np.random.default_rng(7)
    easy, hard = (measured(size * rng.standard_normal(SHAPE), size) for size in (0.02, 0.2))
    together = pooled([easy, hard])
    assert together is not None
    assert easy.rank_correlation == hard.rank_correlation == 0.0
    assert together.rank_correlation > 0.5
    assert together.surest_abs_rel == pytest.approx(easy.all_abs_rel, rel=0.15)
    assert together.within_one_sigma == pytest.approx(0.683, abs=0.05)
    assert pooled([]) is None


def test_too_near_by_a_factor_is_as_wrong_as_too_far_by_it() -> None:
    near, far = (measured(np.full(SHAPE, math.log(factor)), 0.6) for factor in (0.5, 2.0))
    assert near.coverage == far.coverage == (0.0, 0.0, 1.0, 1.0)


def test_sky_unknown_and_nonsense_are_not_measured() -> None:
    truth = np.array([[10.0, np.inf, np.nan, 0.0, DEPTH_CAP_M + 1, 10.0, 10.0, 10.0]], np.float32)
    predicted = np.array([[10.0, 1.0, 1.0, 1.0, 1.0, np.nan, 10.0, np.inf]], np.float32)
    sigma = np.array([[0.1, 9.0, 9.0, 9.0, 9.0, 0.1, np.nan, 0.1]], np.float32)
    found = doubt_errors(*(np.repeat(part, MIN_PIXELS, axis=0) for part in (truth, predicted, sigma)))
    assert found is not None
    assert found.all_abs_rel == 0.0
    assert found.sample_error.size == MIN_PIXELS, "one pixel of each row is left"
    assert doubt_errors(truth, predicted, sigma) is None, "too few pixels"


@given(st.lists(st.integers(0, 6), min_size=2, max_size=40))
def test_rank_correlation_is_one_with_itself_and_does_not_ask_for_units(numbers: list[int]) -> None:
    values = np.array(numbers, np.float64)
    expected = 0.0 if len(set(numbers)) == 1 else 1.0
    assert spearman(values, np.exp(values)) == pytest.approx(expected)
    assert spearman(values, -values) == pytest.approx(-expected)


def test_equal_values_share_their_mean_rank() -> None:
    # Ranks 1, 2.5, 2.5, 4 against 1, 2, 3, 4: worked out by hand.
    found = spearman(np.array([1.0, 5.0, 5.0, 9.0]), np.array([1.0, 2.0, 3.0, 4.0]))
    assert found == pytest.approx(4.5 / math.sqrt(4.5 * 5.0))
