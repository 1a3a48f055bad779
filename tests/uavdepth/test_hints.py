"""Hints as planes: the ground where geometry puts it, points in the pixels they belong to."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from uavdepth import Attitude, CameraModel, CameraMount, GroundHint, HintError, PointHints
from uavdepth.model.hint_planes import FARTHEST_GROUND_M, MOST_POINTS, ground_plane, point_pixels

WIDTH, HEIGHT, FOCAL_PX = 96, 48, 77.0
LEVEL = Attitude(0.0, 0.0, 0.0)
STRAIGHT = CameraMount()


def depth_of(q: np.ndarray, camera: CameraModel) -> np.ndarray:
    """Metres of a plane in the network's unit."""
    with np.errstate(divide="ignore"):
        return np.asarray(camera.fx * WIDTH / camera.width / (FOCAL_PX * q))


def points(pixels: list[tuple[float, float]], depth_m: list[float], sigma: list[float]) -> PointHints:
    return PointHints(
        np.array(pixels, np.float32), np.array(depth_m, np.float32), np.array(sigma, np.float32)
    )


class TestGround:
    @pytest.mark.parametrize("distortion", [(), (-0.28, 0.07, 0.001, -0.002)])
    @given(
        roll=st.floats(-0.5, 0.5),
        pitch=st.floats(-0.5, 0.5),
        tilt_deg=st.floats(-40.0, 20.0),
        height_m=st.floats(1.0, 60.0),
    )
    def test_every_ray_times_its_depth_ends_on_the_ground(self, distortion, roll, pitch, tilt_deg, height_m):
        camera = CameraModel(128, 96, 80.0, 90.0, 60.0, 50.0, distortion)
        mount = CameraMount(pitch_deg=tilt_deg, forward_m=0.2, right_m=-0.1, down_m=0.1)
        attitude = Attitude(roll, pitch, 2.0)
        q = ground_plane(GroundHint(mount, attitude, height_m), camera, WIDTH, HEIGHT, FOCAL_PX)
        seen = q > 0
        depth_m = depth_of(q, camera)[seen]
        rays = camera.scaled(WIDTH, HEIGHT).normalized_rays[seen].astype(np.float64)
        in_body = (rays * depth_m[:, None]) @ mount.body_from_camera.T + mount.position_body_m
        below_m = in_body @ attitude.level_from_body[2]
        np.testing.assert_allclose(below_m, height_m, rtol=1e-3)

    @given(pitch=st.floats(-0.3, 0.3), height_m=st.floats(0.5, 60.0))
    def test_there_is_no_ground_above_the_horizon_and_beyond_the_farthest(self, pitch, height_m):
        camera = CameraModel.from_fov(WIDTH, HEIGHT, 90.0)
        attitude = Attitude(0.0, pitch, 0.0)
        q = ground_plane(GroundHint(STRAIGHT, attitude, height_m), camera, WIDTH, HEIGHT, FOCAL_PX)
        down = camera.normalized_rays @ STRAIGHT.body_from_camera.T @ attitude.level_from_body[2]
        exact_m = np.where(down > 0, height_m / np.maximum(down, 1e-12), np.inf)
        clearly = np.abs(exact_m / FARTHEST_GROUND_M - 1) > 1e-3
        np.testing.assert_array_equal((q > 0)[clearly], (exact_m <= FARTHEST_GROUND_M)[clearly])

    def test_its_unit_is_the_networks_own(self):
        # A level camera 2 m up: a ray that falls by 1 in 4 meets the ground at 8 m of depth.
        camera = CameraModel(640, 320, 200.0, 200.0, 319.5, 159.5)
        q = ground_plane(GroundHint(STRAIGHT, LEVEL, 2.0), camera, 320, 160, 100.0)
        row = round((159.5 + 200.0 / 4 + 0.5) / 2 - 0.5)
        falls = ((row + 0.5) * 2 - 0.5 - 159.5) / 200.0
        assert q[row, 160] == pytest.approx((200.0 * 0.5) / (100.0 * 2.0 / falls), rel=1e-5)

    def test_a_camera_at_the_ground_or_below_it_knows_none(self):
        camera = CameraModel.from_fov(WIDTH, HEIGHT, 90.0)
        hanging = CameraMount(down_m=1.0, pitch_deg=-45.0)
        for height_m in (0.5, 1.0, 1.04):
            assert not ground_plane(GroundHint(hanging, LEVEL, height_m), camera, 32, 16, 20.0).any()
        assert ground_plane(GroundHint(hanging, LEVEL, 1.2), camera, 32, 16, 20.0).any()

    @pytest.mark.parametrize(
        ("attitude", "height_m", "text"),
        [
            (Attitude(math.nan, 0.0, 0.0), 2.0, "roll_rad is nan"),
            (Attitude(0.0, math.inf, 0.0), 2.0, "pitch_rad is inf"),
            (LEVEL, math.nan, "height_m is nan"),
            (LEVEL, 0.0, r"height_m is 0\.0"),
            (LEVEL, -3.0, r"height_m is -3\.0"),
        ],
    )
    def test_what_no_vehicle_knows_is_refused(self, attitude, height_m, text):
        with pytest.raises(HintError, match=text):
            GroundHint(STRAIGHT, attitude, height_m)

    @pytest.mark.parametrize("arguments", [(0, 16, 20.0), (32, -1, 20.0), (32, 16, 0.0), (32, 16, math.nan)])
    def test_a_size_or_focal_length_that_cannot_be_is_refused(self, arguments):
        camera = CameraModel.from_fov(WIDTH, HEIGHT, 90.0)
        with pytest.raises(HintError):
            ground_plane(GroundHint(STRAIGHT, LEVEL, 2.0), camera, *arguments)
        with pytest.raises(HintError):
            point_pixels(points([(1, 1)], [1], [0]), camera, *arguments)


class TestPoints:
    camera = CameraModel(2 * WIDTH, 3 * HEIGHT, 100.0, 110.0, 90.0, 70.0)

    def planes(self, hints: PointHints) -> np.ndarray:
        return point_pixels(hints, self.camera, WIDTH, HEIGHT, FOCAL_PX).planes

    def test_a_point_lands_in_the_pixel_that_covers_it_with_its_depth_and_confidence(self):
        planes = self.planes(points([(21.4, 31.6)], [8.0], [0.1]))
        assert planes.shape == (2, HEIGHT, WIDTH)
        assert planes.dtype == np.float32
        # x: (21.4 + 0.5) / 2 = 10.95, y: (31.6 + 0.5) / 3 = 10.7
        assert np.argwhere(planes[0]).tolist() == [[10, 10]]
        assert depth_of(planes[0], self.camera)[10, 10] == pytest.approx(8.0, rel=1e-5)
        assert planes[1][10, 10] == pytest.approx(0.5)
        assert np.count_nonzero(planes[1]) == 1

    @given(
        x=st.floats(-0.5, 2 * WIDTH - 0.5, exclude_max=True, width=32),
        y=st.floats(-0.5, 3 * HEIGHT - 0.5, exclude_max=True, width=32),
    )
    def test_a_point_lands_where_its_part_of_the_resized_picture_does(self, x, y):
        (row, column) = np.argwhere(self.planes(points([(x, y)], [5.0], [0.0]))[0])[0]
        assert (row, column) == (math.floor((y + 0.5) / 3), math.floor((x + 0.5) / 2))

    def test_points_outside_the_picture_are_left_out(self):
        outside = [(-0.6, 5), (2 * WIDTH - 0.4, 5), (5, -0.6), (5, 3 * HEIGHT - 0.4), (1e30, 5)]
        planes = self.planes(points([*outside, (5, 5)], [3.0] * 6, [0.0] * 6))
        assert np.count_nonzero(planes[0]) == 1

    def test_of_two_points_in_one_pixel_the_surer_stays_and_of_equals_the_nearer(self):
        planes = self.planes(
            points([(10, 10), (10, 10), (30, 30), (30, 30)], [4.0, 9.0, 7.0, 6.0], [0.2, 0.05, 0.1, 0.1])
        )
        depth_m = depth_of(planes[0], self.camera)
        assert depth_m[3, 5] == pytest.approx(9.0, rel=1e-5)
        assert depth_m[10, 15] == pytest.approx(6.0, rel=1e-5)

    def test_of_more_points_than_networks_know_the_surest_are_used(self):
        count = MOST_POINTS + 50
        cells = [(2 * (number % WIDTH), 3 * (number // WIDTH)) for number in range(count)]
        sigma = [0.5 if number < 50 else 0.1 for number in range(count)]
        planes = self.planes(points(cells, [5.0] * count, sigma))
        assert np.count_nonzero(planes[1]) == MOST_POINTS
        np.testing.assert_allclose(planes[1][planes[1] > 0], 0.5)

    def test_no_points_are_no_hint(self):
        assert not self.planes(points([], [], [])).any()
        assert len(points([], [], [])) == 0

    @pytest.mark.parametrize(
        ("pixels", "depth_m", "sigma", "text"),
        [
            ([(1, math.nan)], [1.0], [0.1], "pixels of point 0 is nan"),
            ([(1, 1), (2, 2)], [1.0, math.inf], [0.1, 0.1], "depth_m of point 1 is inf"),
            ([(1, 1)], [0.0], [0.1], "depth_m of point 0 is 0: above 0 m"),
            ([(1, 1)], [-2.0], [0.1], "depth_m of point 0 is -2"),
            ([(1, 1)], [1.0], [-0.1], "relative_sigma of point 0 is -0.1"),
            ([(1, 1)], [1.0], [math.nan], "relative_sigma of point 0 is nan"),
            ([(1, 1)], [1.0, 2.0], [0.1], r"depth_m has the shape \(2,\): \(1,\)"),
            ([(1, 1, 1)], [1.0], [0.1], r"shape \(1, 3\): \(N, 2\)"),
        ],
    )
    def test_what_no_scene_has_is_refused_by_the_point(self, pixels, depth_m, sigma, text):
        with pytest.raises(HintError, match=text):
            points(pixels, depth_m, sigma)

    def test_hints_keep_what_they_were_given(self):
        depth_m = np.array([5.0], np.float32)
        hints = PointHints(np.zeros((1, 2), np.float32), depth_m, np.zeros(1, np.float32))
        depth_m[0] = 9.0
        assert hints.depth_m[0] == 5.0
        with pytest.raises(ValueError, match="read-only"):
            hints.depth_m[0] = 1.0
