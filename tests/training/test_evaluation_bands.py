"""Distance bands take every scored pixel, each once, and say what happens there."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from training.evaluation_bands import BAND_EDGES_M, band_names, banded_errors, mean_of_bands
from training.metrics import DEPTH_CAP_M, MIN_PIXELS, SMALLEST_DEPTH_M, depth_metrics, measurable

BANDS = len(BAND_EDGES_M) - 1


def filled(*values: float) -> np.ndarray[tuple[int, ...], np.dtype[np.float32]]:
    """A map in which each value has as many pixels as are needed to say something."""
    return np.repeat(np.array(values, np.float32), MIN_PIXELS)[None]


@given(st.lists(st.floats(0.0, 120.0, width=32), min_size=1, max_size=12), st.floats(0.5, 2.0))
def test_the_bands_divide_the_scored_pixels_among_them(truths: list[float], factor: float) -> None:
    truth = filled(*truths)
    errors = banded_errors(truth, truth * np.float32(factor))
    scored = int(np.count_nonzero(measurable(truth, truth)))
    if errors is None:
        assert scored < MIN_PIXELS
        return
    assert sum(errors.pixels) == scored
    parts = [
        (found.abs_rel, pixels) for found, pixels in zip(errors.bands, errors.pixels, strict=True) if found
    ]
    assert sum(pixels for _, pixels in parts) == scored
    mean = sum(value * pixels for value, pixels in parts) / scored
    assert mean == pytest.approx(errors.overall.abs_rel, rel=1e-6, abs=1e-9)


def test_each_distance_falls_into_the_band_that_begins_with_it() -> None:
    truths = (SMALLEST_DEPTH_M, 2.0, 5.0, 10.0, 20.0, 40.0)
    errors = banded_errors(filled(*truths), filled(*truths))
    assert errors is not None
    assert errors.pixels == (MIN_PIXELS,) * BANDS
    assert band_names() == ["0-2 m", "2-5 m", "5-10 m", "10-20 m", "20-40 m", "40-80 m"]


def test_an_error_in_one_band_stays_there() -> None:
    errors = banded_errors(filled(1.0, 3.0, 30.0), filled(1.0, 4.5, 30.0))
    assert errors is not None
    by_band = [None if band is None else band.abs_rel for band in errors.bands]
    assert by_band == [0.0, pytest.approx(0.5), None, None, 0.0, None]
    assert errors.overall.abs_rel == pytest.approx(0.5 / 3)


def test_the_overall_errors_are_those_of_the_picture() -> None:
    rng = np.random.default_rng(1)
    truth = rng.uniform(0.5, 100.0, (40, 60)).astype(np.float32)
    predicted = (truth * rng.uniform(0.5, 1.5, truth.shape)).astype(np.float32)
    errors = banded_errors(truth, predicted, 1.2)
    assert errors is not None
    assert errors.overall == depth_metrics(truth, predicted, 1.2)


def test_pictures_without_a_band_do_not_count_in_its_mean() -> None:
    near = banded_errors(filled(1.0), filled(1.1))
    both = banded_errors(filled(1.0, 3.0), filled(1.3, 3.0))
    assert near is not None
    assert both is not None
    means = mean_of_bands([near, both])
    (first, first_pictures), (second, second_pictures) = means[:2]
    assert first is not None
    assert second is not None
    assert first.abs_rel == pytest.approx(0.2)
    assert (first_pictures, second_pictures) == (2, 1)
    assert second.abs_rel == 0.0
    assert means[5] == (None, 0)


def test_nothing_to_score_has_no_errors() -> None:
    assert banded_errors(filled(DEPTH_CAP_M), filled(1.0)) is None
