"""Networks whose inverse depth has a scale and a shift of its own, and what is said of the sky."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from training.evaluation_affine import fit_to_points, fit_to_truth
from training.evaluation_sky import FAR_M, sky_errors
from training.evaluation_sources import Answer
from uavdepth.camera import CameraModel
from uavdepth.model.hints import PointHints

CAMERA = CameraModel.from_fov(60, 40, 80.0)


def truth() -> NDArray[np.float32]:
    """(40, 60) depths of 1 to 60 m, sky above."""
    depth = np.geomspace(60.0, 1.0, 40 * 60).reshape(40, 60).astype(np.float32)
    depth[:5] = np.inf
    return depth


def affine(scale: float, shift: float) -> NDArray[np.float32]:
    """The network's answer: inverse depth is `scale * answer + shift`."""
    return ((1.0 / truth() - shift) / scale).astype(np.float32)


def points(depth_m: NDArray[np.float32], *, outliers: int = 0) -> PointHints:
    rng = np.random.default_rng(1)
    row, column = rng.integers(5, 40, 60), rng.integers(0, 60, 60)
    known = depth_m[row, column].copy()
    known[:outliers] *= 5.0
    return PointHints(np.stack([column, row], axis=1), known, np.full(60, 0.05))


@given(st.floats(0.01, 50.0), st.floats(-0.5, 0.5))
def test_scale_and_shift_are_found_from_the_truth(scale: float, shift: float) -> None:
    found = fit_to_truth(affine(scale, shift), truth())
    assert found is not None
    ground = np.isfinite(truth())
    assert np.allclose(found[ground], truth()[ground], rtol=0.02)
    assert (found[~ground] > 60.0).all(), "the sky comes out beyond everything"


def test_scale_and_shift_are_found_from_points_in_spite_of_outliers() -> None:
    found = fit_to_points(affine(2.0, 0.1), points(truth(), outliers=6), CAMERA)
    assert found is not None
    ground = np.isfinite(truth())
    assert np.allclose(found[ground], truth()[ground], rtol=0.02)


def test_a_network_that_takes_near_for_far_is_not_fitted() -> None:
    assert fit_to_truth(-affine(1.0, 0.0), truth()) is None
    assert fit_to_points(-affine(1.0, 0.0), points(truth()), CAMERA) is None


def test_nothing_to_fit_to_gives_no_depth() -> None:
    nothing = np.full_like(truth(), np.nan)
    assert fit_to_truth(affine(1.0, 0.0), nothing) is None
    assert fit_to_truth(nothing, truth()) is None
    assert fit_to_points(nothing, points(truth()), CAMERA) is None


def test_an_answer_is_fitted_only_where_it_is_affine() -> None:
    metres = Answer(truth())
    assert metres.fitted(truth()) is metres
    fitted = Answer(np.full_like(truth(), np.nan), affine_inverse_depth=affine(3.0, 0.0)).fitted(truth())
    assert not fitted.metric, "the truth's help is no metres"
    ground = np.isfinite(truth())
    assert np.allclose(fitted.depth_m[ground], truth()[ground], rtol=0.02)


def test_sky_should_be_far_and_unsure() -> None:
    depth, sky = truth(), np.isinf(truth())
    sigma = np.where(sky, 0.8, 0.1).astype(np.float32)
    right = sky_errors(depth, np.where(sky, 200.0, depth).astype(np.float32), sigma)
    assert right is not None
    assert (right.far_share, right.sigma, right.sigma_elsewhere) == (
        1.0,
        pytest.approx(0.8),
        pytest.approx(0.1),
    )
    wrong = sky_errors(depth, np.where(sky, FAR_M / 2, depth).astype(np.float32), None)
    assert wrong is not None
    assert (wrong.far_share, wrong.sigma) == (0.0, None)


def test_unknown_sky_is_not_near_and_a_picture_without_sky_says_nothing() -> None:
    depth = truth()
    unknown = sky_errors(depth, np.full_like(depth, np.nan), np.full_like(depth, np.nan))
    assert unknown is not None
    assert (unknown.far_share, unknown.sigma) == (1.0, None)
    assert sky_errors(depth[5:], depth[5:], None) is None
