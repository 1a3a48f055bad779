"""Training frames: which worlds, how stored, how drawn and changed without breaking their depth."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from frames import ground_frame, make_store
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from training.data.augmentation import MAX_WIDENING, Crop, change_light, cut_depth, cut_image, sample_crop
from training.data.batches import BatchRequest, BatchSource, FramePool, make_batch, network_image
from training.data.camera_sampling import (
    FIELD_OF_VIEW_DEG,
    FOCAL_RATIO,
    MOUNT_PITCH_DEG,
    sample_camera,
    sample_mount,
)
from training.data.frame_store import NewFrame, read_frames, write_frames
from training.data.pose_sampling import SAFE_CLEARANCE_M, sample_poses
from training.data.rendering import RenderPlan, render_plan
from training.data.seed_split import SeedSplit
from training.data.thin_approach import THIN_DISTANCE_M, thin_rays
from training.errors import TrainingDataError
from training.normalization import MAX_DEPTH_M, depth_from_output, log_inverse_depth
from uavdepth.attitude import Attitude
from uavdepth.errors import SceneError
from uavdepth.scenes import HELD_OUT_SCENES


@given(st.integers(0, 999_999))
def test_every_seed_belongs_to_exactly_one_split(seed: int) -> None:
    assert sum(seed in split.value for split in SeedSplit) == 1


@pytest.mark.parametrize(
    ("seed", "split"),
    [
        (0, SeedSplit.TRAIN),
        (899, SeedSplit.TRAIN),
        (900, SeedSplit.VALIDATION),
        (999, SeedSplit.VALIDATION),
        (1000, SeedSplit.TEST),
    ],
)
def test_test_worlds_begin_at_1000_and_validation_at_900(seed: int, split: SeedSplit) -> None:
    assert SeedSplit.of(seed) is split


def test_a_plan_for_training_refuses_a_world_kept_for_tests(tmp_path: Path) -> None:
    plan = RenderPlan(tmp_path, ("city",), SeedSplit.TRAIN, 899, 2, 1)
    with pytest.raises(TrainingDataError, match="seed 900 belongs to validation"):
        list(plan.worlds())


def test_a_world_without_room_to_fly_is_named_and_the_others_are_rendered(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def render(scene: tuple[str, int], *_: object) -> list[NewFrame]:
        if scene[1] == 1:
            raise SceneError("no clear path")
        return [ground_frame()]

    monkeypatch.setattr("training.data.rendering.load_scene", lambda name, seed: (name, seed))
    monkeypatch.setattr("training.data.rendering.render_world", render)
    plan = RenderPlan(tmp_path, ("city",), SeedSplit.TRAIN, 0, 3, 1)
    with pytest.raises(SceneError, match="no clear path"):
        render_plan(plan)
    left_out: list[tuple[str, int, str]] = []
    assert render_plan(plan, left_out=lambda *what: left_out.append(what)) == 1
    assert left_out == [("city", 1, "no clear path")]


def test_training_refuses_a_store_with_a_test_world(tmp_path: Path) -> None:
    make_store(tmp_path, (("city", 3), ("city", 1000)))
    with pytest.raises(TrainingDataError, match="seed 1000 belongs to test"):
        FramePool(tmp_path)


@pytest.mark.parametrize("scene", HELD_OUT_SCENES)
def test_a_held_out_scene_is_never_trained_on(tmp_path: Path, scene: str) -> None:
    plan = RenderPlan(tmp_path, ("wall", scene), SeedSplit.TRAIN, 0, 1, 1)
    with pytest.raises(TrainingDataError, match=rf"{scene}.*held out"):
        list(plan.worlds())
    SeedSplit.TEST.require_world(scene, 1000)


def test_a_store_with_frames_of_a_held_out_scene_is_refused(tmp_path: Path) -> None:
    folder = write_frames(tmp_path, HELD_OUT_SCENES[0], 3, [ground_frame()])
    assert folder.is_dir()
    with pytest.raises(TrainingDataError, match="held out"):
        FramePool(tmp_path)


def test_a_negative_seed_is_in_no_split() -> None:
    with pytest.raises(TrainingDataError, match="-1"):
        SeedSplit.of(-1)


@given(st.integers(0, 2**32 - 1))
def test_sampled_cameras_are_as_drones_carry_them(seed: int) -> None:
    rng = np.random.default_rng(seed)
    camera, mount = sample_camera(rng, 384, 192), sample_mount(rng)
    view_deg = math.degrees(2 * math.atan(384 / 2 / camera.fx))
    assert FIELD_OF_VIEW_DEG[0] - 1e-6 <= view_deg <= FIELD_OF_VIEW_DEG[1] + 1e-6
    assert FOCAL_RATIO[0] <= camera.fy / camera.fx <= FOCAL_RATIO[1]
    assert MOUNT_PITCH_DEG[0] - 1 < mount.pitch_deg < MOUNT_PITCH_DEG[1] + 5


class Corridor:
    """A world of flat ground between two walls at 20 m to the north and south."""

    WALL_M = 20.0

    def ground_height_m(self, north_m: float, east_m: float) -> float:
        return 0.0

    def ray_distance_m(
        self, origin_ned_m: NDArray[np.float64], direction_ned: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        north = direction_ned[0]
        if abs(north) < 1e-9:
            return np.array([np.inf])
        return np.array([(math.copysign(self.WALL_M, north) - origin_ned_m[0]) / north])

    def clearance_m(self, position_ned_m: Sequence[float]) -> float:
        return max(0.0, min(self.WALL_M - abs(position_ned_m[0]), -position_ned_m[2]))

    def flight(self, seed: int, duration_s: float) -> Corridor:
        return self

    def at(self, t_s: float) -> Corridor:
        return self

    @property
    def position_ned_m(self) -> NDArray[np.float64]:
        return np.array([0.0, 0.0, -3.0])

    @property
    def attitude(self) -> Attitude:
        return Attitude(0.0, 0.0, 0.0)


def test_pictures_are_taken_clear_of_obstacles_and_some_right_before_them() -> None:
    world = Corridor()
    poses = sample_poses(world, np.random.default_rng(1), 80)
    clearances = [world.clearance_m(position.tolist()) for position, _ in poses]
    to_wall = [Corridor.WALL_M - abs(position[0]) for position, _ in poses]
    assert len(poses) == 80
    assert min(clearances) >= SAFE_CLEARANCE_M
    assert sum(distance < 5.0 for distance in to_wall) > 5
    assert sum(abs(attitude.roll_rad) > 0.15 for _, attitude in poses) > 5


class Posts(Corridor):
    """Posts 0.2 m thick, 30 m apart, in the open: from most places none is near."""

    RADIUS_M = 0.1

    def clearance_m(self, position_ned_m: Sequence[float]) -> float:
        off = np.hypot(*(self._off(np.array(position_ned_m[:2]))))
        return float(off) - self.RADIUS_M

    def ray_distance_m(
        self, origin_ned_m: NDArray[np.float64], direction_ned: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        flat = direction_ned[..., :2]
        posts = np.stack(np.meshgrid(*2 * [np.arange(-75.0, 76.0, 30.0)]), -1).reshape(-1, 2)
        to_posts = posts - np.asarray(origin_ned_m)[..., None, :2]
        unit = flat / np.linalg.norm(flat, axis=-1, keepdims=True)
        ahead = (to_posts * unit[..., None, :]).sum(-1)
        aside = np.sqrt(np.maximum((to_posts**2).sum(-1) - ahead**2, 0.0))
        met = (ahead > 0) & (aside < self.RADIUS_M)
        level_m = np.where(met, ahead, np.inf).min(-1)
        return np.asarray(level_m / np.linalg.norm(flat, axis=-1))

    @staticmethod
    def _off(place: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(place % 30.0 - 15.0)


def seen_from(world: Posts, poses: list[tuple[NDArray[np.float64], Attitude]]) -> list[float]:
    """Distance of the nearest post in a picture 92 degrees wide, level, for each pose."""
    found = []
    for position, attitude in poses:
        bearings = np.radians(np.arange(-46.0, 46.0, 0.25)) + attitude.yaw_rad
        rays = np.stack([np.cos(bearings), np.sin(bearings), np.zeros(len(bearings))], 1)
        found.append(float(world.ray_distance_m(np.broadcast_to(position, rays.shape), rays).min()))
    return found


def test_pictures_of_thin_things_are_taken_right_before_them_and_clear_of_them() -> None:
    world = Posts()
    near = sample_poses(world, np.random.default_rng(3), 40, thin_share=1.0)
    assert min(world.clearance_m(position.tolist()) for position, _ in near) >= SAFE_CLEARANCE_M
    # An upright look meets a post somewhat above or below the vehicle; level it is nearer still.
    distances = np.array(seen_from(world, near))
    assert distances.max() < THIN_DISTANCE_M[1] + 0.5
    assert 0.15 < np.mean(distances > 8.0) < 0.6, "log-uniform: neither only near nor only far"
    elsewhere = [(place, Attitude(0.0, 0.0, yaw)) for place, yaw in anywhere(40)]
    assert np.median(seen_from(world, elsewhere)) > 2.0 * np.median(distances)


def anywhere(count: int) -> list[tuple[NDArray[np.float64], float]]:
    rng = np.random.default_rng(4)
    return [(np.array([*rng.uniform(-40, 40, 2), -3.0]), rng.uniform(-3.0, 3.0)) for _ in range(count)]


def test_thin_is_what_has_something_farther_on_either_side() -> None:
    step = math.radians(0.25)
    distances = np.full(200, 10.0)
    distances[50:54] = 4.0  # 7 cm
    distances[100:160] = 4.0  # 1 m: no thin thing
    distances[195:] = 4.0  # what is beside it is not known
    assert thin_rays(distances, step).tolist() == [50, 51, 52, 53]
    distances[50:54] = 8.5  # too near to what is behind
    assert thin_rays(distances, step).tolist() == []


@given(st.floats(0.5, 150.0), st.floats(50.0, 400.0))
def test_depth_and_the_networks_word_for_it_are_each_others_inverse(depth: float, fx: float) -> None:
    word = log_inverse_depth(np.array([depth], np.float32), fx)
    assert depth_from_output(word, fx)[0] == pytest.approx(depth, rel=1e-4)


def test_zooming_in_tells_the_network_the_same_world() -> None:
    depth = np.array([5.0], np.float32)
    assert log_inverse_depth(depth, 400.0) - log_inverse_depth(depth, 200.0) == pytest.approx(math.log(2.0))


def test_sky_is_taught_as_the_largest_depth() -> None:
    word = log_inverse_depth(np.array([np.inf], np.float32), 230.0)
    assert depth_from_output(word, 230.0)[0] == pytest.approx(MAX_DEPTH_M, rel=1e-4)


@given(st.integers(0, 2**32 - 1))
def test_crops_lie_within_the_picture_and_keep_most_of_it(seed: int) -> None:
    crop = sample_crop(np.random.default_rng(seed), 480, 240)
    assert 0 <= crop.left <= 480 - crop.width
    assert 0 <= crop.top <= 240 - crop.height
    assert crop.width > 0.6 * 480
    assert crop.height > 0.6 * 240 / MAX_WIDENING


def test_some_crops_are_as_wide_as_wide_cameras_pictures() -> None:
    rng = np.random.default_rng(0)
    aspects = np.array(
        [crop.width / crop.height for crop in (sample_crop(rng, 480, 240) for _ in range(400))]
    )
    assert 0.1 < np.mean(aspects > 2.6) < 0.3
    assert aspects.max() > 3.3


def test_picture_and_depth_are_cut_and_mirrored_alike() -> None:
    depth = np.tile(np.arange(160, dtype=np.float32), (96, 1))
    image = np.repeat(depth.astype(np.uint8)[..., None], 3, axis=2)
    crop = Crop(left=20, top=10, width=120, height=60, mirrored=True)
    cut = cut_depth(depth, crop, 60, 30)
    picture = cut_image(image, crop, 60, 30)
    assert cut[0, 0] > cut[0, -1]
    assert np.abs(picture[..., 0].astype(float) - cut).max() <= 1.0
    assert set(np.unique(cut)) <= set(np.unique(depth))


def test_light_changes_but_size_and_kind_do_not() -> None:
    image = ground_frame().image_bgr
    changed = [change_light(np.random.default_rng(seed), image) for seed in range(30)]
    assert all(item.shape == image.shape and item.dtype == np.uint8 for item in changed)
    assert sum(not np.array_equal(item, image) for item in changed) > 25


def test_the_network_sees_red_first_and_grey_as_nothing() -> None:
    picture = np.zeros((2, 3, 3), np.uint8)
    picture[..., 2] = 255
    seen = network_image(picture)
    assert seen.shape == (3, 2, 3)
    assert seen[0].min() > 0.9
    assert seen[1:].max() < -0.9
    assert np.abs(network_image(np.full((2, 3, 3), 127, np.uint8))).max() < 1e-6


def test_the_truth_of_a_batch_is_the_ground_that_was_painted(tmp_path: Path) -> None:
    records = read_frames(make_store(tmp_path, (("city", 0),)))
    batch = make_batch(records, np.random.default_rng(3), 96, 64)
    assert batch.image.shape == (3, 3, 64, 96)
    assert batch.log_inverse_depth.shape == batch.far.shape == (3, 1, 64, 96)
    assert bool(batch.far.any())
    assert not bool(batch.far.all())
    # A camera 6 m up sees everything four times as far as one 1.5 m up.
    nearest = [float(item[~far].max()) for item, far in zip(batch.log_inverse_depth, batch.far, strict=True)]
    assert nearest[0] > nearest[1] > nearest[2]


def test_a_batch_is_a_function_of_its_number(tmp_path: Path) -> None:
    pool = FramePool(make_store(tmp_path))
    first = BatchSource(pool, seed=5).make(BatchRequest(11, 4, 64, 64))
    again = BatchSource(pool, seed=5).make(BatchRequest(11, 4, 64, 64))
    other = BatchSource(pool, seed=5).make(BatchRequest(12, 4, 64, 64))
    assert np.array_equal(first.image.numpy(), again.image.numpy())
    assert not np.array_equal(first.image.numpy(), other.image.numpy())


def test_batches_made_ahead_come_in_order(tmp_path: Path) -> None:
    source = BatchSource(FramePool(make_store(tmp_path)), seed=5)
    requests = [BatchRequest(number, 2, 64, 64) for number in range(5)]
    for request, batch in zip(requests, source.stream(iter(requests)), strict=True):
        assert np.array_equal(batch.image.numpy(), source.make(request).image.numpy())


def test_new_worlds_join_while_training_goes_on(tmp_path: Path) -> None:
    pool = FramePool(make_store(tmp_path))
    assert (len(pool), pool.worlds) == (6, 2)
    make_store(tmp_path, (("forest", 2),))
    pool.rescan()
    assert (len(pool), pool.worlds) == (9, 3)


def test_a_scene_of_few_frames_is_not_learnt_by_heart(tmp_path: Path) -> None:
    pool = FramePool(make_store(tmp_path, (("city", 0), ("wall", 1))), shares={"city": 1.0, "wall": 1.0})
    many = pool.draw(np.random.default_rng(1), 300)
    assert 100 < sum(record.scene == "wall" for record in many) < 200
    make_store(tmp_path, tuple(("city", seed) for seed in range(2, 11)))
    pool.rescan()
    fewer = pool.draw(np.random.default_rng(1), 300)
    assert 10 < sum(record.scene == "wall" for record in fewer) < 60
