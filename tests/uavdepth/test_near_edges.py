"""Edges near the vehicle: a plain post before a painted wall has no corner, and is measured by its edges."""

from __future__ import annotations

import math
from collections.abc import Callable

import cv2
import numpy as np
import pytest
from moving_camera import Place, stops_after, straight, told, wall_picture
from numpy.typing import NDArray

from uavdepth import Attitude, CameraModel, CameraMount, PointHints
from uavdepth.motion.edge_search import FARTHEST_M, EdgeView, measure_edges
from uavdepth.motion.motion_point_settings import MotionPointSettings
from uavdepth.motion.motion_points import MotionPoints
from uavdepth.motion.vehicle_motion import CameraMotion, MotionNoise, VehicleMotion

CAMERA = CameraModel.from_fov(320, 160, 90)
WALL_M = 12.0
POST_M = 3.0
POST_WIDTH_M = 0.2


def post_picture(
    camera: CameraModel,
    place: tuple[float, float, float],
    yaw_rad: float = 0.0,
    post_east_m: float = 1.0,
    post_m: float = POST_M,
    width_m: float = POST_WIDTH_M,
) -> NDArray[np.uint8]:
    """The painted wall, and before it one upright post of one dull colour, endless up and down."""
    scale = 4
    fine = camera.scaled(camera.width * scale, camera.height * scale)
    image = wall_picture(camera, place, WALL_M, yaw_rad)
    turn = Attitude(0.0, 0.0, yaw_rad).ned_from_body @ CameraMount().body_from_camera
    rays = fine.normalized_rays.astype(np.float64) @ turn.T
    reach = (post_m - place[0]) / np.maximum(rays[..., 0], 0.05)
    east = place[1] + reach * rays[..., 1]
    covered = (np.abs(east - post_east_m) < width_m / 2) & (reach > 0)
    share = cv2.resize(
        covered.astype(np.float32), (camera.width, camera.height), interpolation=cv2.INTER_AREA
    )
    return np.asarray(np.rint(image * (1 - share[..., None]) + 30.0 * share[..., None]), np.uint8)


def fly(
    points: MotionPoints,
    place: Place,
    seconds: float,
    motion: VehicleMotion | None = None,
    picture: Callable[[float], NDArray[np.uint8]] | None = None,
    yaw_rad: Callable[[float], float] = lambda t_s: 0.0,
) -> list[PointHints]:
    """Points of pictures of ten a second."""
    heard = motion or told(place, seconds + 1, yaw_rad)
    shown = picture or (lambda t_s: post_picture(points.camera, place(t_s)[0], yaw_rad(t_s)))
    return [
        points.update(shown(step / 10), step * 100_000_000, heard) for step in range(round(seconds * 10) + 1)
    ]


def near(found: PointHints, limit_m: float = 6.0) -> PointHints:
    """Those that can only be of the post."""
    chosen = found.depth_m < limit_m
    return PointHints(found.pixels[chosen], found.depth_m[chosen], found.relative_sigma[chosen])


@pytest.mark.parametrize("velocity", [(0.0, 1.5, 0.0), (0.5, 1.2, 0.0), (0.5, -1.0, 0.3)])
def test_a_plain_post_before_a_wall_is_measured(velocity: tuple[float, float, float]) -> None:
    place = straight(velocity)
    found = fly(MotionPoints(CAMERA, CameraMount()), place, 1.2)[-1]
    post = near(found)
    position = place(1.2)[0]
    depth_m = POST_M - position[0]
    column = CAMERA.cx + CAMERA.fx * (1.0 - position[1]) / depth_m
    half_px = CAMERA.fx * POST_WIDTH_M / 2 / depth_m
    assert len(post) >= 6
    np.testing.assert_allclose(post.depth_m, depth_m, rtol=0.1)
    assert np.all(np.abs(np.abs(post.pixels[:, 0] - column) - half_px) < 4.0)
    assert np.all(np.abs(post.depth_m / depth_m - 1) < 3 * post.relative_sigma)
    assert post.pixels[:, 1].max() - post.pixels[:, 1].min() > 0.4 * CAMERA.height


def test_without_edges_the_post_is_not_seen_and_the_corners_are_the_same() -> None:
    place = straight((0.0, 1.5, 0.0))
    both = MotionPoints(CAMERA, CameraMount())
    found = fly(both, place, 1.2)[-1]
    corners = fly(MotionPoints(CAMERA, CameraMount(), MotionPointSettings(edges=False)), place, 1.2)[-1]
    assert len(near(corners)) <= 2
    assert len(found) > len(corners)
    for name in ("pixels", "depth_m", "relative_sigma"):
        np.testing.assert_array_equal(getattr(both.corners, name), getattr(corners, name))


def test_a_lens_that_bends_is_taken_into_account() -> None:
    bent = CameraModel(320, 160, 160.0, 160.0, 159.5, 79.5, (-0.2, 0.05, 0.0, 0.0))
    place = straight((0.0, 1.5, 0.0))
    post = near(fly(MotionPoints(bent, CameraMount()), place, 1.2)[-1])
    assert len(post) >= 6
    np.testing.assert_allclose(post.depth_m, POST_M, rtol=0.1)
    expected = bent.projected(np.array([[1.0 - 1.8, 0.0, POST_M]]))[0, 0]
    middle = post.pixels[np.abs(post.pixels[:, 1] - bent.cy) < 20, 0]
    assert np.all(np.abs(middle - expected) < 10)


def test_an_attitude_that_errs_is_made_right_by_the_corners() -> None:
    place = straight((0.0, 1.5, 0.0))
    rng = np.random.default_rng(11)
    motion = VehicleMotion(MotionNoise())
    for step in range(60):
        error = rng.normal(0.0, math.radians(0.3), 3)
        motion.add_attitude(step * 50_000_000, Attitude(*error))
        motion.add_position(step * 50_000_000, *place(step / 20))
    post = near(fly(MotionPoints(CAMERA, CameraMount()), place, 1.4, motion)[-1])
    assert len(post) >= 6
    np.testing.assert_allclose(np.median(post.depth_m), POST_M, rtol=0.1)


def test_what_is_farther_than_the_limit_is_never_told_near() -> None:
    """A wall at 12 m with a row of like bars on it: repeated edges, of which none may look near."""
    place = straight((0.0, 1.5, 0.0))

    def bars(t_s: float) -> NDArray[np.uint8]:
        image = wall_picture(CAMERA, place(t_s)[0], WALL_M)
        for east_m in np.arange(-14.0, 16.0, 0.75):
            image = np.minimum(
                image, post_picture(CAMERA, place(t_s)[0], post_east_m=east_m, post_m=WALL_M, width_m=0.3)
            )
        return image

    for found in fly(MotionPoints(CAMERA, CameraMount()), place, 1.2, picture=bars):
        assert not len(found) or found.depth_m.min() > FARTHEST_M


def test_in_a_hover_none_are_measured_and_those_there_were_last_a_second() -> None:
    place = stops_after((0.0, 1.5, 0.0), 1.0)
    found = fly(MotionPoints(CAMERA, CameraMount()), place, 4.0)
    corners = fly(MotionPoints(CAMERA, CameraMount(), MotionPointSettings(edges=False)), place, 4.0)
    assert len(found[10]) >= len(corners[10]) + 6
    assert len(found[40]) == len(corners[40])


def test_edges_come_nearer_as_the_vehicle_does() -> None:
    place = straight((0.5, -1.0, 0.0))
    points = MotionPoints(CAMERA, CameraMount())
    for step, found in enumerate(fly(points, place, 1.2)):
        post = near(found)
        if len(post):
            np.testing.assert_allclose(post.depth_m, POST_M - step / 20, rtol=0.12)


def test_a_jump_of_the_attitude_leaves_no_edges() -> None:
    place = straight((0.0, 1.5, 0.0))
    motion = VehicleMotion(MotionNoise())
    for step in range(40):
        yaw = 0.0 if step < 23 else 0.6
        motion.add_attitude(step * 50_000_000, Attitude(0.0, 0.0, yaw))
        motion.add_position(step * 50_000_000, *place(step / 20))
    found = fly(MotionPoints(CAMERA, CameraMount()), place, 1.2, motion)
    assert len(near(found[11])) >= 6
    assert len(found[12]) == 0


def _view(offset_m: tuple[float, float, float]) -> EdgeView:
    moved = CameraMotion(np.eye(3), np.array(offset_m), 0.01)
    grey = cv2.cvtColor(post_picture(CAMERA, (0.0, -offset_m[0], 0.0)), cv2.COLOR_BGR2GRAY)
    return EdgeView(np.asarray(grey, np.uint8), moved)


def test_one_view_and_too_short_a_baseline_measure_nothing() -> None:
    grey = np.asarray(cv2.cvtColor(post_picture(CAMERA, (0.0, 0.0, 0.0)), cv2.COLOR_BGR2GRAY), np.uint8)
    assert measure_edges(grey, [_view((0.5, 0.0, 0.0))], CAMERA) is None
    assert measure_edges(grey, [_view((0.2, 0.0, 0.0)), _view((0.1, 0.0, 0.0))], CAMERA) is None
    found = measure_edges(grey, [_view((0.5, 0.0, 0.0)), _view((0.25, 0.0, 0.0))], CAMERA)
    assert found is not None
    np.testing.assert_allclose(found.points[:, 2], POST_M, rtol=0.08)


@pytest.mark.parametrize(("width", "height"), [(320, 160), (320, 6), (5, 160)])
def test_a_picture_without_texture_or_room_measures_nothing(width: int, height: int) -> None:
    plain = np.full((height, width), 90, np.uint8)
    views = [EdgeView(plain, CameraMotion(np.eye(3), np.array([b, 0.0, 0.0]), 0.01)) for b in (0.5, 0.3)]
    assert measure_edges(plain, views, CAMERA.scaled(width, height)) is None


@pytest.mark.parametrize("seed", range(5))
def test_pictures_that_have_nothing_to_do_with_each_other_measure_next_to_nothing(seed: int) -> None:
    rng = np.random.default_rng(seed)
    noise = [cv2.GaussianBlur(rng.uniform(0, 255, (160, 320)), (0, 0), 2.0) for _ in range(4)]
    grey, *others = (np.clip((part - 127) * 6 + 127, 0, 255).astype(np.uint8) for part in noise)
    moves = [CameraMotion(np.eye(3), np.array([b, 0.0, 0.0]), 0.01) for b in (0.6, 0.35, 0.2)]
    found = measure_edges(grey, [EdgeView(*pair) for pair in zip(others, moves, strict=True)], CAMERA)
    assert found is None or len(found.points) <= 4


@pytest.mark.parametrize("far_m", [12.0, 23.0, 37.0, 61.0])
@pytest.mark.parametrize("apart_px", [9.0, 12.3, 17.0])
def test_rows_of_windows_far_away_are_not_told_near(far_m: float, apart_px: float) -> None:
    """Climbing before a facade: with steps of its period over the like, it looks as if near and moving on."""
    baselines = (0.51, 0.34, 0.17)

    def rows(shift_px: float) -> NDArray[np.uint8]:
        fine = (np.arange(160 * 8) + 0.5) / 8 - 0.5 + shift_px
        line = np.where(np.mod(fine, apart_px) < 0.45 * apart_px, 60.0, 180.0).reshape(160, 8).mean(axis=1)
        return np.repeat(np.rint(line).astype(np.uint8)[:, None], 320, axis=1)

    views = [
        EdgeView(rows(CAMERA.fy * b / far_m), CameraMotion(np.eye(3), np.array([0.0, -b, 0.0]), 0.01))
        for b in baselines
    ]
    assert measure_edges(rows(0.0), views, CAMERA) is None


@pytest.mark.parametrize("yaw_rad", [0.0, 0.3, 0.6, -0.6])
def test_a_far_fence_is_not_told_near_while_the_vehicle_turns(yaw_rad: float) -> None:
    """What is at the border is outside the other pictures: only others like it are to be found there."""
    fence_m, period_m = 25.0, 1.5
    baselines = (0.6, 0.4, 0.2)

    def seen(east_m: float, yaw: float) -> NDArray[np.uint8]:
        fine = CAMERA.scaled(CAMERA.width * 4, CAMERA.height)
        turn = Attitude(0.0, 0.0, yaw).ned_from_body @ CameraMount().body_from_camera
        rays = fine.normalized_rays.astype(np.float64) @ turn.T
        east = east_m + fence_m / np.maximum(rays[..., 0], 0.05) * rays[..., 1]
        grey = np.where(np.mod(east, period_m) < 0.5 * period_m, 60.0, 180.0).astype(np.float32)
        size = CAMERA.width, CAMERA.height
        return np.asarray(np.rint(cv2.resize(grey, size, interpolation=cv2.INTER_AREA)), np.uint8)

    def moved(baseline: float, yaw: float) -> CameraMotion:
        turned = Attitude(0.0, 0.0, yaw).ned_from_body
        camera = CameraMount().body_from_camera
        return CameraMotion((turned @ camera).T @ camera, np.array([baseline, 0.0, 0.0]), 0.01)

    yaws = [yaw_rad * share for share in (1.0, 0.7, 0.4)]
    views = [EdgeView(seen(-b, yaw), moved(b, yaw)) for b, yaw in zip(baselines, yaws, strict=True)]
    assert measure_edges(seen(0.0, 0.0), views, CAMERA) is None
