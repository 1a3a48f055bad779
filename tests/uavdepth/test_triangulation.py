"""Triangulation of exact points: depth, and the standard deviation that goes with it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from uavdepth import CameraMount
from uavdepth.motion.triangulation import Triangulation, triangulate
from uavdepth.motion.vehicle_motion import CameraMotion, MotionNoise
from uavdepth.rotation import rotation_zyx

PIXEL = 0.3 / 320
SURE = MotionNoise(attitude_rad=1e-5, velocity_mps=1e-4, position_m=1e-4)
POSES = (0.25, 0.5, 0.75, 1.0)
AXES = CameraMount().body_from_camera
"""Body axes of camera vectors: forward is z."""


def cloud(count: int = 120, seed: int = 3) -> NDArray[np.float64]:
    """(N, 3) points in view, 5 to 30 m away."""
    rng = np.random.default_rng(seed)
    depth = rng.uniform(5.0, 30.0, count)
    return (
        np.column_stack([rng.uniform(-0.8, 0.8, count), rng.uniform(-0.4, 0.4, count), np.ones(count)])
        * (depth[:, None])
    )


def flown(
    offset_m: tuple[float, float, float],
    turn_deg: tuple[float, float, float] = (0, 0, 0),
    sigma_m: float = 1e-4,
) -> list[CameraMotion]:
    """Earlier views of a camera that has come by `offset_m` (camera axes) while turning."""
    turn = np.radians(turn_deg)
    return [
        CameraMotion(
            AXES.T @ rotation_zyx(*(turn * share)) @ AXES, np.array(offset_m) * share, sigma_m * share
        )
        for share in POSES
    ]


def seen_from(points: NDArray[np.float64], motions: list[CameraMotion]) -> NDArray[np.float64]:
    there = [(points + motion.offset_m) @ motion.rotation.T for motion in motions]
    return np.array([each[:, :2] / each[:, 2:] for each in there])


def solve(
    points: NDArray[np.float64],
    motions: list[CameraMotion],
    seen: NDArray[np.float64] | None = None,
    noise: MotionNoise = SURE,
    given: list[CameraMotion] | None = None,
) -> Triangulation:
    return triangulate(
        points[:, :2] / points[:, 2:],
        seen_from(points, motions) if seen is None else seen,
        given or motions,
        np.full(len(motions), PIXEL),
        noise,
        PIXEL,
    )


@given(st.floats(-2, 2), st.floats(-1, 1), st.floats(0.5, 2), st.floats(-25, 25), st.floats(-10, 10))
def test_without_noise_depth_is_exact(
    right: float, down: float, ahead: float, yaw_deg: float, roll_deg: float
) -> None:
    points = cloud()
    found = solve(points, flown((right, down, ahead), (roll_deg, 3.0, yaw_deg)))
    clear = found.relative_sigma < 0.05
    assert clear.sum() > 5
    np.testing.assert_allclose(found.depth_m[clear], points[clear, 2], rtol=0.01)
    assert found.residual[clear].max() < 0.1


def test_sigma_is_as_one_over_the_parallax() -> None:
    points = cloud()
    near = solve(points, flown((1.0, 0.0, 0.0)))
    far = solve(points, flown((2.0, 0.0, 0.0)))
    np.testing.assert_allclose(np.median(near.relative_sigma / far.relative_sigma), 2.0, rtol=0.1)
    np.testing.assert_allclose(np.median(far.parallax_rad / near.parallax_rad), 2.0, rtol=0.1)


def test_sigma_tells_how_far_depth_is_off() -> None:
    rng = np.random.default_rng(11)
    points, motions, inside = cloud(200), flown((1.0, 0.1, 0.8), sigma_m=0.05), []
    noise = MotionNoise(attitude_rad=math.radians(0.5))
    for _ in range(20):
        # The autopilot's errors: one of velocity that lasts, and one of attitude in each view.
        wrong = rng.normal(0, 0.05, 3)
        said = [
            CameraMotion(
                AXES.T @ rotation_zyx(*rng.normal(0, noise.attitude_rad, 3)) @ AXES @ motion.rotation,
                motion.offset_m + wrong * share,
                motion.sigma_m,
            )
            for motion, share in zip(motions, POSES, strict=True)
        ]
        seen = seen_from(points, motions)
        found = solve(points, motions, seen + rng.normal(0, PIXEL, seen.shape), noise, said)
        error = np.abs(np.log(found.depth_m / points[:, 2]))
        good = found.relative_sigma < 0.2
        inside.append(np.mean(error[good] < found.relative_sigma[good]))
    assert 0.58 < float(np.mean(inside)) < 0.88


def test_an_attitude_that_is_off_by_a_degree_is_found_out() -> None:
    points, motions = cloud(), flown((1.5, 0.0, 0.5))
    said = [
        CameraMotion(
            AXES.T @ rotation_zyx(0.005, 0.012, 0.017) @ AXES @ motion.rotation,
            motion.offset_m,
            motion.sigma_m,
        )
        for motion in motions
    ]
    noise = MotionNoise(attitude_rad=math.radians(0.5), velocity_mps=1e-4)
    found = solve(points, motions, seen_from(points, motions), noise, said)
    clear = found.relative_sigma < 0.1
    assert clear.sum() > 80
    assert np.median(np.abs(found.depth_m[clear] / points[clear, 2] - 1)) < 0.02


def test_doubt_about_the_speed_goes_into_every_point() -> None:
    points = cloud()
    found = solve(points, flown((0.0, 0.0, 1.0), sigma_m=0.1), noise=MotionNoise(attitude_rad=1e-5))
    assert found.relative_sigma.min() > 0.08


@pytest.mark.parametrize("across_m", [0.3, 0.6, -0.5])
def test_a_thing_that_moves_across_its_epipolar_lines_does_not_fit(across_m: float) -> None:
    points, motions = cloud(), flown((1.5, 0.0, 0.0))
    seen = seen_from(points, motions)
    for view, share in enumerate(POSES):
        there = points[:10] + np.array([0.0, across_m * share, 0.0]) + motions[view].offset_m
        seen[view, :10] = there[:, :2] / there[:, 2:]
    found = solve(points, motions, seen)
    assert found.residual[:10].min() > 1.8
    assert found.residual[10:].max() < 1.0
    np.testing.assert_allclose(found.depth_m[10:], points[10:, 2], rtol=0.02)


def test_flight_along_the_axis_tells_nothing_near_the_point_it_heads_for() -> None:
    rim = np.array([[0.5, 0.3, 1.0], [-0.6, 0.3, 1.0], [0.5, -0.3, 1.0]]) * 10.0
    points = np.vstack([cloud(60), rim, [[0.05, 0.02, 10.0]]])
    found = solve(points, flown((0.0, 0.0, 1.5)))
    assert found.relative_sigma[-1] > 0.2
    assert found.relative_sigma[-4:-1].max() < 0.05


def test_turning_without_moving_tells_no_depth() -> None:
    found = solve(cloud(), flown((0.0, 0.0, 0.0), (0.0, 0.0, 20.0)))
    assert found.parallax_rad.max() < math.radians(0.6)
    assert found.relative_sigma.min() > 0.5


def test_views_that_did_not_see_a_point_say_nothing_of_it() -> None:
    points, motions = cloud(), flown((1.5, 0.0, 0.0))
    seen = seen_from(points, motions)
    seen[2:, 0] = np.nan
    seen[:, 1] = np.nan
    found = solve(points, motions, seen)
    assert list(found.views[:3]) == [2, 0, 4]
    assert found.depth_m[0] == pytest.approx(points[0, 2], rel=0.02)
    assert found.relative_sigma[1] > 1.0
