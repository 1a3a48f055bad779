"""Hints of training pictures: exactly where the augmented picture has them, and wrong as a vehicle's are."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from frames import ground_frame, make_store
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from training.data.augmentation import Crop, cut_depth, sample_crop
from training.data.batches import make_batch
from training.data.frame_store import read_frames
from training.data.hint_sampling import HintShares, hint_maps, sample_ground_hint, sample_hints
from training.data.point_hints import FARTHEST_POINT_M, sample_point_hints
from training.data.views import View, mirrored_view, view_of_crop
from training.errors import TrainingSettingsError
from training.normalization import FOCAL_REFERENCE_PX
from uavdepth.attitude import Attitude
from uavdepth.camera import CameraModel, CameraMount
from uavdepth.model.hint_planes import ground_plane
from uavdepth.model.hints import GroundHint, Hints, PointHints
from uavdepth.scenes import load_scene

CAMERA = CameraModel(160, 96, 95.0, 80.0, 78.0, 50.0)
MOUNT = CameraMount(roll_deg=3.0, pitch_deg=-12.0, yaw_deg=8.0)
ATTITUDE = Attitude(0.12, -0.06, 0.9)


def down_along_rays(view: View) -> NDArray[np.float32]:
    """(H, W) metres that each pixel's ray goes down for each metre of z-depth."""
    down = (view.attitude.level_from_body @ view.mount.body_from_camera)[2]
    return np.asarray(view.camera.normalized_rays @ down.astype(np.float32), np.float32)


@given(st.integers(0, 2**32 - 1))
def test_the_view_of_a_crop_looks_where_the_crop_of_the_picture_looks(seed: int) -> None:
    view = View(CAMERA, MOUNT, ATTITUDE)
    crop = sample_crop(np.random.default_rng(seed), CAMERA.width, CAMERA.height)
    cropped = view_of_crop(view, crop, crop.width, crop.height)
    wanted = cut_depth(down_along_rays(view), crop, crop.width, crop.height)
    assert np.allclose(down_along_rays(cropped), wanted, atol=1e-5)


@pytest.mark.parametrize("mirrored", [False, True])
def test_on_a_rendered_frame_the_grounds_hint_is_the_truth_on_every_pixel_of_ground(mirrored: bool) -> None:
    scene = load_scene("wall", 1)
    position, attitude = [0.0, 0.0, -6.0], Attitude(0.15, -0.1, 0.3)
    mount = CameraMount(pitch_deg=-20.0, roll_deg=2.0)
    camera = CameraModel(160, 80, 90.0, 85.0, 76.0, 41.0)
    depth = scene.render(camera, mount, position, attitude).depth_m
    crop = Crop(left=13, top=9, width=128, height=64, mirrored=mirrored)
    # The size of the window: a resized depth map shows each pixel a fraction of one off.
    view = view_of_crop(View(camera, mount, attitude), crop, crop.width, crop.height)
    cut = cut_depth(depth, crop, crop.width, crop.height)
    height_m = scene.rangefinder_m(position)
    assert height_m is not None
    hint = ground_plane(
        GroundHint(view.mount, view.attitude, height_m), view.camera, 128, 64, FOCAL_REFERENCE_PX
    )
    truth = view.camera.fx / (FOCAL_REFERENCE_PX * cut)
    below_m = cut * down_along_rays(view)
    ground = (np.abs(below_m - height_m) < 0.02 * height_m) & (cut < 60.0)
    assert ground.mean() > 0.2
    assert np.allclose(hint[ground], truth[ground], rtol=0.03)
    assert np.median(np.abs(hint[ground] / truth[ground] - 1.0)) < 2e-3


def test_a_mirror_seen_in_a_mirror_is_the_view_itself() -> None:
    camera = replace(CAMERA, distortion=(0.1, -0.02, 0.003, -0.004, 0.01))
    view = View(camera, replace(MOUNT, right_m=0.2, forward_m=0.1), ATTITUDE)
    assert mirrored_view(mirrored_view(view)) == view
    assert mirrored_view(view).mount.right_m == -0.2


@pytest.mark.parametrize("length", [4, 5, 8, 12, 14])
def test_the_lens_of_a_mirrored_picture_is_the_mirrored_lens(length: int) -> None:
    numbers = (0.08, -0.02, 0.01, -0.015, 0.004, 0.02, 0.003, -0.001, 0.01, 0.002, -0.01, 0.003, 0.02, -0.03)
    view = View(replace(CAMERA, distortion=numbers[:length]), CameraMount(), Attitude(0.0, 0.0, 0.0))
    rays, mirrored = view.camera.normalized_rays, mirrored_view(view).camera.normalized_rays
    assert np.allclose(mirrored[:, ::-1, 0], -rays[..., 0], atol=1e-4)
    assert np.allclose(mirrored[:, ::-1, 1], rays[..., 1], atol=1e-4)


def test_hints_are_dropped_as_often_as_they_should_be() -> None:
    rng, shares = np.random.default_rng(5), HintShares()
    drawn = Counter(shares.draw(rng) for _ in range(4000))
    for kind, share in (
        ((False, False), shares.none),
        ((True, False), shares.ground),
        ((False, True), shares.points),
        ((True, True), shares.both),
    ):
        assert drawn[kind] / 4000 == pytest.approx(share, abs=0.03)


@pytest.mark.parametrize("shares", [(0.5, 0.5, 0.5, 0.5), (-0.2, 0.4, 0.4, 0.4), (math.nan, 0.3, 0.3, 0.4)])
def test_shares_that_are_none_are_refused(shares: tuple[float, float, float, float]) -> None:
    with pytest.raises(TrainingSettingsError, match="together 1"):
        HintShares(*shares)


def test_a_batch_brings_the_hints_that_its_shares_ask_for(tmp_path: Path) -> None:
    records = read_frames(make_store(tmp_path, (("city", 0),)))
    for shares, ground, points in (
        (HintShares(1.0, 0.0, 0.0, 0.0), False, False),
        (HintShares(0.0, 1.0, 0.0, 0.0), True, False),
        (HintShares(0.0, 0.0, 1.0, 0.0), False, True),
        (HintShares(0.0, 0.0, 0.0, 1.0), True, True),
    ):
        batch = make_batch(records, np.random.default_rng(3), 96, 64, shares)
        assert bool((batch.ground.flatten(1).amax(1) > 0).all()) is ground
        assert bool((batch.ground > 0).any()) is ground
        assert bool((batch.points > 0).any()) is points


def test_the_hints_of_a_batch_are_near_its_truth(tmp_path: Path) -> None:
    records = read_frames(make_store(tmp_path, (("city", 0),))) * 4
    shares = HintShares(0.0, 0.0, 0.0, 1.0)
    batch = make_batch(records, np.random.default_rng(4), 160, 96, shares)
    truth = np.exp(batch.log_inverse_depth.numpy())
    ground = batch.ground.numpy()
    for hint, wanted, far in zip(ground, truth, batch.far.numpy(), strict=True):
        shown = (hint > 0) & ~far
        assert np.median(np.abs(np.log(hint[shown] / wanted[shown]))) < 0.35
    q, confidence = batch.points[:, :1].numpy(), batch.points[:, 1:].numpy()
    measured = confidence > 0
    assert measured.sum() > 50
    assert np.array_equal(q > 0, measured)
    assert np.median(np.abs(np.log(q[measured] / truth[measured]))) < 0.1


def textured_frame(
    size: tuple[int, int] = (320, 160),
) -> tuple[NDArray[np.uint8], NDArray[np.float32], CameraModel]:
    """A plane that recedes from 2 m at the bottom to 160 m, with sky above and a texture of patches."""
    width, height = size
    rng = np.random.default_rng(6)
    patches = rng.integers(0, 256, (height // 8, width // 8, 3), dtype=np.uint8)
    image = np.asarray(cv2.resize(patches, size, interpolation=cv2.INTER_NEAREST), np.uint8)
    rows = np.geomspace(160.0, 2.0, height - 40)
    depth = np.full((height, width), np.inf, np.float32)
    depth[40:] = rows[:, None]
    return image, depth, CameraModel.from_fov(width, height, 90.0)


def many_points(frames: int = 40, count: int = 200) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Relative errors and reported sigmas of the points of many pictures, with the true depth at each."""
    image, depth, camera = textured_frame()
    rng = np.random.default_rng(7)
    errors, truths = [], []
    for _ in range(frames):
        points = sample_point_hints(rng, image, depth, camera, count)
        column, row = np.rint(points.pixels).astype(int).T
        truth = depth[np.clip(row, 0, 159), column]
        errors.append((points.depth_m / truth - 1.0) / points.relative_sigma)
        truths.append(truth)
    return np.concatenate(errors), np.concatenate(truths)


def test_no_point_lies_on_the_sky_or_too_far_away() -> None:
    image, depth, camera = textured_frame()
    for seed in range(20):
        points = sample_point_hints(np.random.default_rng(seed), image, depth, camera, 300)
        # A tracker slips by a pixel: the row below the sky's edge may hold its last points.
        assert points.pixels[:, 1].min() >= 39
        assert len(points) <= 300
        assert np.median(points.depth_m) < FARTHEST_POINT_M


def test_most_errors_are_those_of_the_reported_sigma_and_few_are_outliers() -> None:
    errors, truths = many_points()
    finite = errors[np.isfinite(truths)]
    assert 0.5 < np.mean(np.abs(finite) < 1.0) < 0.8
    assert 0.01 < np.mean(np.abs(finite) > 4.0) < 0.15


def test_far_points_are_less_certain_than_near_ones() -> None:
    image, depth, camera = textured_frame()
    points = sample_point_hints(np.random.default_rng(8), image, depth, camera, 300)
    near, far = points.depth_m < 5.0, points.depth_m > 20.0
    assert np.median(points.relative_sigma[far]) > 1.3 * np.median(points.relative_sigma[near])
    assert points.relative_sigma.min() > 0.005


def test_a_plain_picture_has_few_points() -> None:
    image, depth, camera = textured_frame()
    plain = np.full_like(image, 120)
    counts = [
        len(sample_point_hints(np.random.default_rng(seed), picture, depth, camera, 100))
        for picture in (plain, image)
        for seed in range(10)
    ]
    assert sum(counts[:10]) < 0.4 * sum(counts[10:])


def test_a_picture_of_sky_has_no_points() -> None:
    image, depth, camera = textured_frame()
    sky = np.full_like(depth, np.inf)
    assert len(sample_point_hints(np.random.default_rng(9), image, sky, camera, 100)) == 0


def test_some_pictures_have_their_points_in_one_corner() -> None:
    image, depth, camera = textured_frame()
    spreads = [
        float(np.std(sample_point_hints(np.random.default_rng(seed), image, depth, camera, 100).pixels[:, 0]))
        for seed in range(30)
    ]
    assert min(spreads) < 0.6 * max(spreads)


def test_the_grounds_hint_is_wrong_by_centimetres_and_tenths_of_a_degree() -> None:
    rng, view = np.random.default_rng(10), View(CAMERA, MOUNT, ATTITUDE)
    hints = [sample_ground_hint(rng, view, 10.0) for _ in range(500)]
    heights = np.array([hint.height_m for hint in hints if hint is not None])
    rolls = np.array([hint.attitude.roll_rad for hint in hints if hint is not None])
    assert len(heights) == 500
    assert np.std(heights) == pytest.approx(math.hypot(0.3, 0.1), rel=0.15)
    assert np.std(rolls) == pytest.approx(math.radians(0.7), rel=0.15)


def test_on_the_ground_there_is_no_hint_of_it() -> None:
    view = View(CAMERA, MOUNT, ATTITUDE)
    rng = np.random.default_rng(11)
    assert all(sample_ground_hint(rng, view, 0.01) is None for _ in range(30))
    frame = ground_frame()
    always = HintShares(0.0, 1.0, 0.0, 0.0)
    unknown = sample_hints(
        rng, View(frame.camera, frame.mount, frame.attitude), None, frame.image_bgr, frame.depth_m, always
    )
    assert unknown == Hints()


def test_without_hints_the_maps_are_empty_and_points_lie_at_their_pixels() -> None:
    view = View(CAMERA, MOUNT, ATTITUDE)
    ground, points = hint_maps(Hints(), view, 160, 96)
    assert ground.shape == (1, 96, 160)
    assert not ground.any()
    assert not points.any()
    one = PointHints(np.array([[30.0, 20.0]]), np.array([5.0]), np.array([0.1]))
    _, points = hint_maps(Hints(points=one), view, 160, 96)
    assert points[0, 20, 30] == pytest.approx(CAMERA.fx / (FOCAL_REFERENCE_PX * 5.0), rel=1e-5)
    assert points[1, 20, 30] == pytest.approx(0.5)
