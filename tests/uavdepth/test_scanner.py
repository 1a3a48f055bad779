"""Obstacles in their elements, at their distances, however the camera sits."""

from __future__ import annotations

import math

import numpy as np
import pytest
from elements import attitude_deg, element, obstacles
from solids import box, depth_of, ground, pole, wall

from uavdepth import (
    Attitude,
    CameraModel,
    CameraMount,
    ImageSizeError,
    ObstacleScanner,
    ScanError,
    SectorState,
)

OBSTACLE, CLEAR, UNKNOWN = SectorState.OBSTACLE, SectorState.CLEAR, SectorState.UNKNOWN


class TestPoles:
    @pytest.mark.parametrize("bearing", [-30, -10, 0, 10, 30])
    def test_r4_a_pole_lands_in_its_own_element_at_its_distance(self, camera, mount, level, bearing):
        depth = depth_of([pole(bearing, 8.0, 0.1)], camera, mount, level)
        scan = ObstacleScanner(camera, mount).scan(depth, level)
        assert obstacles(scan) == [element(bearing)]
        assert scan.bearing_deg[element(bearing)] == bearing
        assert scan.distance_m[element(bearing)] == pytest.approx(7.9, rel=0.02)

    @pytest.mark.parametrize("pitch", [-25, 25])
    @pytest.mark.parametrize("roll", [-25, 0, 25])
    def test_a_tilted_vehicle_reports_the_same_horizontal_distance(self, camera, mount, pitch, roll):
        attitude = attitude_deg(roll, pitch)
        depth = depth_of([pole(10, 6.0, 0.1)], camera, mount, attitude)
        scan = ObstacleScanner(camera, mount).scan(depth, attitude)
        assert obstacles(scan) == [element(10)]
        assert scan.nearest_m == pytest.approx(5.9, rel=0.02)

    def test_r3_yaw_does_not_move_elements(self, camera, mount, level):
        depth = depth_of([pole(10, 6.0, 0.1)], camera, mount, level)
        scanner = ObstacleScanner(camera, mount)
        north, west = scanner.scan(depth, level), scanner.scan(depth, attitude_deg(yaw=-90))
        np.testing.assert_array_equal(north.state, west.state)
        np.testing.assert_array_equal(north.distance_m, west.distance_m)

    @pytest.mark.parametrize("bearing", [-33, -8, 2, 21])
    def test_a_pole_thinner_than_a_pixel_column_pair_is_not_lost(self, camera, mount, level, bearing):
        radius = 0.5 * 6.0 * 1.6 / camera.fx
        depth = depth_of([pole(bearing, 6.0, radius), wall(60)], camera, mount, level)
        columns = (depth < 10).any(axis=0).sum()
        assert 1 <= columns <= 3
        scan = ObstacleScanner(camera, mount).scan(depth, level)
        assert element(bearing) in obstacles(scan)
        assert scan.nearest_m == pytest.approx(6.0, rel=0.02)

    def test_of_two_things_in_one_element_the_nearer_counts(self, camera, mount, level):
        depth = depth_of([pole(-1, 6.0, 0.1), wall(6.9)], camera, mount, level)
        scan = ObstacleScanner(camera, mount).scan(depth, level)
        assert scan.distance_m[element(0)] == pytest.approx(5.9, rel=0.03)

    def test_distance_is_horizontal_not_depth_and_not_slant(self, camera, mount, level):
        # 40 degrees to the side z-depth is 23 % short of the distance.
        depth = depth_of([pole(40, 10.0, 0.3)], camera, mount, level)
        scan = ObstacleScanner(camera, mount).scan(depth, level)
        assert scan.distance_m[element(40)] == pytest.approx(9.7, rel=0.02)

    def test_a_wall_beyond_the_range_is_no_obstacle(self, camera, mount, level):
        depth = depth_of([wall(21)], camera, mount, level)
        assert obstacles(ObstacleScanner(camera, mount, max_distance_m=20).scan(depth, level)) == []

    def test_something_at_the_propellers_is_an_obstacle(self, camera, mount, level):
        depth = depth_of([pole(0, 0.16, 0.02)], camera, mount, level)
        scan = ObstacleScanner(camera, mount).scan(depth, level)
        assert scan.state[element(0)] == OBSTACLE
        assert scan.nearest_m == pytest.approx(0.14, abs=0.01)


class TestHeightBand:
    def test_a_thing_above_the_band_is_no_obstacle(self, camera, mount, level):
        roof = box((5, -3, -4.0), (9, 3, -1.6))
        scan = ObstacleScanner(camera, mount, above_m=1.5).scan(depth_of([roof], camera, mount, level), level)
        assert obstacles(scan) == []

    def test_a_thing_reaching_into_the_band_is(self, camera, mount, level):
        roof = box((5, -0.2, -4.0), (9, 0.2, -1.2))
        scan = ObstacleScanner(camera, mount, above_m=1.5).scan(depth_of([roof], camera, mount, level), level)
        assert obstacles(scan) == [element(0)]

    def test_a_thing_below_the_band_is_no_obstacle(self, camera, mount, level):
        hedge = box((6, -3, 2.1), (7, 3, 9.0))
        scan = ObstacleScanner(camera, mount, below_m=2.0).scan(
            depth_of([hedge], camera, mount, level), level
        )
        assert obstacles(scan) == []


class TestMounting:
    @pytest.mark.parametrize("yaw", [-180, -120, -90, 45, 90, 180])
    def test_a_camera_looking_elsewhere_fills_the_elements_there(self, camera, level, yaw):
        mount = CameraMount(yaw_deg=yaw)
        depth = depth_of([pole(yaw, 7.0, 0.1)], camera, mount, level)
        scan = ObstacleScanner(camera, mount).scan(depth, level)
        assert obstacles(scan) == [element(yaw)]
        assert scan.state[element(yaw + 15)] == CLEAR
        assert scan.state[element(yaw + 180)] == UNKNOWN

    @pytest.mark.parametrize(
        "mount",
        [
            CameraMount(pitch_deg=-20),
            CameraMount(roll_deg=90),
            CameraMount(roll_deg=12, pitch_deg=-8, yaw_deg=5),
            CameraMount(roll_deg=180),
        ],
        ids=["nose down", "on its side", "askew", "upside down"],
    )
    def test_a_turned_camera_sees_a_pole_where_it_stands(self, camera, level, mount):
        depth = depth_of([pole(10, 7.0, 0.1), ground(3)], camera, mount, level)
        scan = ObstacleScanner(camera, mount).scan(depth, level, 3.0)
        assert obstacles(scan) == [element(10)]
        assert scan.nearest_m == pytest.approx(6.9, rel=0.02)

    def test_distance_counts_from_the_vehicle_not_from_the_camera(self, camera, level):
        mount = CameraMount(forward_m=0.4, right_m=-0.2, down_m=0.1)
        depth = depth_of([pole(20, 2.0, 0.05)], camera, mount, level)
        scan = ObstacleScanner(camera, mount).scan(depth, level)
        assert obstacles(scan) == [element(20)]
        assert scan.nearest_m == pytest.approx(1.95, rel=0.02)

    def test_the_lever_arm_tilts_with_the_vehicle(self, camera):
        mount = CameraMount(forward_m=0.5, down_m=0.3)
        attitude = attitude_deg(roll=20, pitch=-20)
        depth = depth_of([pole(0, 3.0, 0.05)], camera, mount, attitude)
        scan = ObstacleScanner(camera, mount).scan(depth, attitude)
        assert obstacles(scan) == [element(0)]
        assert scan.nearest_m == pytest.approx(2.95, rel=0.02)

    def test_a_distorted_camera_sees_a_pole_where_it_stands(self, level):
        camera = CameraModel(640, 320, 300, 300, 322, 158, (-0.2, 0.05, 0.001, -0.001))
        mount = CameraMount()
        depth = depth_of([pole(30, 7.0, 0.1)], camera, mount, level)
        scan = ObstacleScanner(camera, mount).scan(depth, level)
        assert obstacles(scan) == [element(30)]
        assert scan.state[element(0)] == CLEAR
        assert (scan.state[element(60) : element(180)] == UNKNOWN).all()

    def test_a_distortion_that_folds_back_does_not_make_the_unseen_clear(self, level):
        # Beyond 45 degrees this polynomial turns round and would lay far directions into the picture.
        camera = CameraModel(640, 320, 400, 400, 319.5, 159.5, (-0.33, 0.0, 0.0, 0.0))
        sky = np.full((320, 640), np.inf, np.float32)
        scan = ObstacleScanner(camera, CameraMount()).scan(sky, level)
        seen = np.degrees(np.arctan2(camera.rays[160, :, 0], camera.rays[160, :, 2]))
        clear = scan.bearing_deg[scan.state == CLEAR]
        assert clear.size > 0
        assert clear.max() + 2.5 <= seen.max() + 0.2
        assert clear.min() - 2.5 >= seen.min() - 0.2


class TestBadInput:
    def test_depth_of_another_size_is_refused_with_both_sizes(self, camera, mount, level):
        with pytest.raises(ImageSizeError, match=r"\(192, 384\).*\(320, 640\)"):
            ObstacleScanner(camera, mount).scan(np.ones((192, 384), np.float32), level)

    @pytest.mark.parametrize("roll", [math.nan, math.inf])
    def test_an_attitude_that_is_not_finite_is_refused(self, camera, mount, roll):
        with pytest.raises(ScanError, match="finite roll and pitch"):
            ObstacleScanner(camera, mount).scan(np.ones((320, 640), np.float32), Attitude(roll, 0.0, 0.0))

    @pytest.mark.parametrize(
        ("settings", "text"),
        [
            ({"min_distance_m": 5.0, "max_distance_m": 5.0}, "5.0 to 5.0"),
            ({"max_distance_m": math.nan}, "nan"),
            ({"max_distance_m": 700.0}, "700"),
            ({"below_m": 0.0}, "below_m is 0.0"),
            ({"above_m": -1.0}, "above_m is -1.0"),
            ({"min_pixels": 0}, "min_pixels is 0"),
            ({"ground_tolerance": 0.6}, "ground_tolerance is 0.6"),
        ],
    )
    def test_impossible_settings_are_refused_by_value(self, camera, mount, settings, text):
        with pytest.raises(ScanError, match=text):
            ObstacleScanner(camera, mount, **settings)

    def test_the_input_is_left_as_it_was(self, camera, mount, level):
        depth = depth_of([wall(5)], camera, mount, level)
        depth[::7, ::5] = np.nan
        before = depth.copy()
        ObstacleScanner(camera, mount).scan(depth, level)
        np.testing.assert_array_equal(depth, before)

    @pytest.mark.parametrize("dtype", [np.float16, np.float64])
    def test_other_kinds_of_float_give_the_same_scan(self, camera, mount, level, dtype):
        depth = np.full((320, 640), 8.0)
        scanner = ObstacleScanner(camera, mount)
        np.testing.assert_array_equal(
            scanner.scan(depth.astype(dtype), level).distance_m,
            scanner.scan(depth.astype(np.float32), level).distance_m,
        )
