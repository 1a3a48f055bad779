"""The camera's place against known points."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from uavdepth.motion.resection import resect

SIGMA = 0.002
"""Half a pixel of a picture 320 wide."""

Array = NDArray[np.float64]


def scattered(count: int = 60, seed: int = 3) -> Array:
    rng = np.random.default_rng(seed)
    depth = rng.uniform(3.0, 15.0, count)
    return np.stack([rng.uniform(-0.8, 0.8, count) * depth, rng.uniform(-0.4, 0.4, count) * depth, depth], 1)


def seen(points: Array, turn: tuple[float, float, float], offset: tuple[float, float, float]) -> Array:
    matrix, _ = cv2.Rodrigues(np.array(turn))
    moved = points @ matrix.T + np.array(offset)
    return np.asarray(moved[:, :2] / moved[:, 2:])


def test_a_small_motion_is_found() -> None:
    points, turn, offset = scattered(), (0.004, -0.006, 0.003), (0.05, -0.03, 0.08)
    rays = seen(points, turn, offset) + np.random.default_rng(0).normal(0, 0.5 * SIGMA, (60, 2))
    found = resect(points, rays, SIGMA, 0.1, 0.01)
    assert found is not None
    assert found.offset_m == pytest.approx(np.array(offset), abs=3 * found.offset_sigma_m)
    assert 0.001 < found.offset_sigma_m < 0.03
    vector, _ = cv2.Rodrigues(found.rotation)
    assert vector.ravel() == pytest.approx(np.array(turn), abs=0.002)
    assert found.agrees.all()


def test_points_that_have_moved_are_told_and_change_nothing() -> None:
    points = scattered()
    rays = seen(points, (0.0, 0.0, 0.0), (0.02, 0.0, 0.04))
    rays[:20] += 0.05
    found = resect(points, rays, SIGMA, 0.1, 0.01)
    assert found is not None
    assert found.agrees.tolist() == [False] * 20 + [True] * 40
    assert found.offset_m == pytest.approx(np.array([0.02, 0.0, 0.04]), abs=0.005)


def test_what_was_told_holds_where_little_is_seen() -> None:
    """A dozen points close together, far away: they cannot tell an offset from a turn."""
    points = scattered(12) * np.array([0.05, 0.05, 1.0]) + np.array([0.0, 0.0, 60.0])
    found = resect(points, seen(points, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)), SIGMA, 0.1, 0.01)
    assert found is not None
    assert found.offset_sigma_m == pytest.approx(0.1, rel=0.05)


@pytest.mark.parametrize("offset", [(0.5, 0.0, 0.0), (0.0, 0.0, 0.6)], ids=["aside", "ahead"])
def test_another_motion_than_was_told_is_none(offset: tuple[float, float, float]) -> None:
    points = scattered()
    assert resect(points, seen(points, (0.0, 0.0, 0.0), offset), SIGMA, 0.05, 0.01) is None


def test_points_that_agree_on_nothing_are_no_motion() -> None:
    points = scattered()
    rays = seen(points, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)) + np.random.default_rng(1).normal(0, 0.05, (60, 2))
    assert resect(points, rays, SIGMA, 0.1, 0.01) is None


def test_too_few_points_and_points_behind_the_camera_are_no_motion() -> None:
    points = scattered()
    rays = seen(points, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    assert resect(points[:11], rays[:11], SIGMA, 0.1, 0.01) is None
    points[5] *= -1
    assert resect(points, rays, SIGMA, 0.1, 0.01) is None
    assert resect(points * np.nan, rays, SIGMA, 0.1, 0.01) is None
