"""Surfaces may look like anything, as long as the look lies on them."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from training.data.surface_patterns import (
    AppearanceShares,
    change_surfaces,
    random_filter,
    surface_pattern,
)
from training.errors import TrainingDataError, TrainingSettingsError
from uavdepth.camera import CameraModel

CAMERA = CameraModel.from_fov(96, 48, horizontal_fov_deg=90.0)
SEEDS = range(40)
ALWAYS = AppearanceShares(1.0, 1.0)


def grey() -> NDArray[np.uint8]:
    return np.full((CAMERA.height, CAMERA.width, 3), 120, np.uint8)


def wall_under_sky(distance_m: float = 4.0) -> NDArray[np.float32]:
    depth = np.full((CAMERA.height, CAMERA.width), distance_m, np.float32)
    depth[: CAMERA.height // 3] = np.inf
    return depth


@pytest.mark.parametrize("seed", SEEDS)
def test_a_pattern_leaves_the_sky_and_the_picture_it_was_given(seed: int) -> None:
    picture, depth = grey(), wall_under_sky()
    painted = surface_pattern(np.random.default_rng(seed), picture, depth, CAMERA)
    assert (picture == 120).all()
    assert (painted[np.isinf(depth)] == 120).all()
    assert painted.dtype == np.uint8


def test_most_patterns_are_seen() -> None:
    seen = [
        surface_pattern(np.random.default_rng(seed), grey(), wall_under_sky(), CAMERA).std() > 3
        for seed in SEEDS
    ]
    assert sum(seen) > 0.5 * len(seen)


@pytest.mark.parametrize("seed", SEEDS)
def test_the_same_place_wears_the_same_paint_from_wherever_it_is_seen(seed: int) -> None:
    """Pixels twice as fine show the same pattern: it hangs on the surface, not on the picture."""
    fine = CAMERA.scaled(2 * CAMERA.width, 2 * CAMERA.height)
    depth = np.full((CAMERA.height, CAMERA.width), 1.5, np.float32)
    coarse = surface_pattern(np.random.default_rng(seed), grey(), depth, CAMERA).astype(float)
    large = np.full((fine.height, fine.width, 3), 120, np.uint8)
    detailed = surface_pattern(
        np.random.default_rng(seed), large, np.full(large.shape[:2], 1.5, np.float32), fine
    ).astype(float)
    halved = detailed.reshape(CAMERA.height, 2, CAMERA.width, 2, 3).mean(axis=(1, 3))
    together = np.corrcoef(halved.ravel(), coarse.ravel())[0, 1] if coarse.std() > 8 else 1.0
    assert together > 0.6


def test_a_pattern_too_fine_to_be_seen_is_its_mean() -> None:
    depth = np.full((CAMERA.height, CAMERA.width), 5000.0, np.float32)
    for seed in SEEDS:
        painted = surface_pattern(np.random.default_rng(seed), grey(), depth, CAMERA)
        assert len(np.unique(painted.reshape(-1, 3), axis=0)) <= 2


def test_a_filter_keeps_mean_and_outline() -> None:
    picture = grey()
    picture[:, CAMERA.width // 2 :] = 200
    for seed in SEEDS:
        filtered = random_filter(np.random.default_rng(seed), picture).astype(float)
        assert filtered.mean() == pytest.approx(picture.mean(), abs=25)
        edge = np.abs(np.diff(filtered.mean(axis=2), axis=1)).mean(axis=0)
        assert abs(int(edge.argmax()) - (CAMERA.width // 2 - 1)) <= 2


def test_without_shares_a_picture_stays_as_it_is() -> None:
    picture = change_surfaces(
        np.random.default_rng(0), grey(), wall_under_sky(), CAMERA, AppearanceShares(0.0, 0.0)
    )
    assert (picture == 120).all()


def test_the_same_numbers_make_the_same_picture() -> None:
    first, second = (
        change_surfaces(np.random.default_rng(3), grey(), wall_under_sky(), CAMERA, ALWAYS) for _ in range(2)
    )
    assert np.array_equal(first, second)


def test_depth_of_another_size_is_refused() -> None:
    with pytest.raises(TrainingDataError, match=r"\(10, 10\)"):
        change_surfaces(np.random.default_rng(0), grey(), np.ones((10, 10), np.float32), CAMERA, ALWAYS)


@pytest.mark.parametrize("share", [-0.1, 1.1, float("nan")])
def test_a_share_that_is_none_is_refused(share: float) -> None:
    with pytest.raises(TrainingSettingsError, match="filters"):
        AppearanceShares(filters=share)
