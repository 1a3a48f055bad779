"""Obstacles in their elements, ground and noise in none, and nothing clear that was not seen."""

from __future__ import annotations

import math

import cv2
import numpy as np
import pytest
from solids import box, depth_of, ground, pole, smooth_noise, wall

from uavdepth import (
    Attitude,
    CameraModel,
    CameraMount,
    ImageSizeError,
    ObstacleScan,
    ObstacleScanner,
    ScanError,
    SectorState,
)

OBSTACLE, CLEAR, UNKNOWN = SectorState.OBSTACLE, SectorState.CLEAR, SectorState.UNKNOWN


def element(bearing_deg: float) -> int:
    return round((bearing_deg + 155) / 5) % 72


def attitude_deg(roll: float = 0.0, pitch: float = 0.0, yaw: float = 0.0) -> Attitude:
    return Attitude(math.radians(roll), math.radians(pitch), math.radians(yaw))


def obstacles(scan: ObstacleScan) -> list[int]:
    return np.flatnonzero(scan.state == OBSTACLE).tolist()


class TestPoles:
    @pytest.mark.parametrize("bearing", [-30, -10, 0, 10, 30])
    def test_a_pole_lands_in_its_own_element_at_its_distance(self, camera, mount, level, bearing):
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

    def test_yaw_does_not_move_elements(self, camera, mount, level):
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


class TestGround:
    @pytest.mark.parametrize("known_height", [True, False], ids=["height known", "height not known"])
    def test_flat_ground_is_never_an_obstacle(self, camera, mount, known_height):
        scanner = ObstacleScanner(camera, mount)
        rng = np.random.default_rng(1)
        for _ in range(100):
            height = float(rng.uniform(1, 30))
            attitude = attitude_deg(rng.uniform(-30, 30), rng.uniform(-30, 30), rng.uniform(-180, 180))
            depth = depth_of([ground(height)], camera, mount, attitude)
            scan = scanner.scan(depth, attitude, height if known_height else None)
            assert obstacles(scan) == [], f"height {height}, {attitude}"

    @pytest.mark.parametrize("height", [1.0, 1.5, 2.0, 2.5, 3.0, 5.0, 15.0])
    def test_ground_with_a_networks_errors_is_no_obstacle(self, camera, mount, height):
        scanner = ObstacleScanner(camera, mount)
        rng = np.random.default_rng(2)
        for _ in range(10):
            attitude = attitude_deg(rng.uniform(-30, 30), rng.uniform(-30, 30))
            depth = depth_of([ground(height)], camera, mount, attitude)
            depth *= smooth_noise(rng, depth.shape, 0.05)
            depth *= rng.normal(1.0, 0.02, depth.shape).astype(np.float32)
            assert obstacles(scanner.scan(depth, attitude, height)) == [], f"{attitude}"

    def test_ground_stays_ground_when_a_coarse_network_is_brought_to_the_cameras_pixels(self, camera, mount):
        scanner = ObstacleScanner(camera, mount)
        rng = np.random.default_rng(9)
        for _ in range(50):
            height = float(rng.uniform(0.5, 6))
            attitude = attitude_deg(rng.uniform(-30, 30), rng.uniform(-30, 30))
            coarse = depth_of([ground(height)], camera.scaled(384, 192), mount, attitude)
            depth = cv2.resize(coarse, (640, 320), interpolation=cv2.INTER_NEAREST_EXACT)
            assert obstacles(scanner.scan(depth, attitude, height)) == [], f"height {height}, {attitude}"

    def test_a_larger_tolerance_forgives_larger_errors(self, camera, mount, level):
        depth = depth_of([ground(2.0)], camera, mount, level) * np.float32(0.72)
        assert obstacles(ObstacleScanner(camera, mount, ground_tolerance=0.2).scan(depth, level, 2.0))
        assert not obstacles(ObstacleScanner(camera, mount, ground_tolerance=0.3).scan(depth, level, 2.0))

    @pytest.mark.parametrize("error_deg", [-1.5, 1.5])
    @pytest.mark.parametrize("height", [1.0, 2.0, 4.0])
    def test_an_attitude_error_makes_no_obstacle_of_the_ground(self, camera, mount, level, height, error_deg):
        depth = depth_of([ground(height)], camera, mount, level)
        scan = ObstacleScanner(camera, mount).scan(depth, attitude_deg(pitch=error_deg), height)
        assert obstacles(scan) == []

    @pytest.mark.parametrize("height", [2.0, None])
    def test_a_small_box_on_the_ground_is_an_obstacle(self, camera, mount, level, height):
        things = [ground(2.0), box((5, -0.25, 1.5), (5.5, 0.25, 2.0))]
        scan = ObstacleScanner(camera, mount).scan(depth_of(things, camera, mount, level), level, height)
        assert element(0) in obstacles(scan)
        assert set(obstacles(scan)) <= {element(-5), element(0), element(5)}
        assert scan.distance_m[element(0)] == pytest.approx(5.0, rel=0.03)

    def test_a_wall_that_fills_the_picture_is_not_taken_for_ground(self, camera, mount, level):
        for pitch in (-30, -10, 0, 10):
            attitude = attitude_deg(pitch=pitch)
            scan = ObstacleScanner(camera, mount).scan(depth_of([wall(4)], camera, mount, attitude), attitude)
            assert element(0) in obstacles(scan)
            assert scan.distance_m[element(0)] == pytest.approx(4.0, rel=0.03)

    def test_a_beam_across_the_way_is_not_taken_for_ground(self, camera, mount, level):
        beam = box((4, -10, 1.0), (4.1, 10, 1.15))
        scan = ObstacleScanner(camera, mount).scan(depth_of([beam], camera, mount, level), level)
        assert scan.distance_m[element(0)] == pytest.approx(4.0, rel=0.03)

    @pytest.mark.parametrize("height", [math.nan, math.inf, 0.0, -3.0])
    def test_an_impossible_height_is_as_good_as_none(self, camera, mount, level, height):
        depth = depth_of([wall(4), ground(1.0)], camera, mount, level)
        scanner = ObstacleScanner(camera, mount)
        with_it, without = scanner.scan(depth, level, height), scanner.scan(depth, level, None)
        np.testing.assert_array_equal(with_it.distance_m, without.distance_m)


class TestDoubt:
    def test_open_sky_and_ground_are_clear_across_the_picture_and_unknown_beside_it(
        self, camera, mount, level
    ):
        scan = ObstacleScanner(camera, mount).scan(depth_of([ground(5)], camera, mount, level), level, 5.0)
        inside = [element(bearing) for bearing in range(-40, 45, 5)]
        assert np.flatnonzero(scan.state == CLEAR).tolist() == inside
        assert (np.delete(scan.state, inside) == UNKNOWN).all()

    def test_an_element_half_outside_the_picture_is_unknown(self, camera, mount, level):
        sky = np.full((320, 640), np.inf, np.float32)
        assert ObstacleScanner(camera, mount).scan(sky, level).state[element(45)] == UNKNOWN

    def test_an_obstacle_in_an_element_half_outside_the_picture_counts(self, camera, mount, level):
        depth = depth_of([pole(43.8, 5.0, 0.05)], camera, mount, level)
        scan = ObstacleScanner(camera, mount).scan(depth, level)
        assert obstacles(scan) == [element(45)]

    def test_unknown_depth_is_unknown(self, camera, mount, level):
        scan = ObstacleScanner(camera, mount).scan(np.full((320, 640), np.nan, np.float32), level, 5.0)
        assert (scan.state == UNKNOWN).all()
        assert np.isnan(scan.distance_m).all()

    @pytest.mark.parametrize("nothing", [0.0, -1.0, -np.inf])
    def test_zero_and_negative_depth_is_unknown(self, camera, mount, level, nothing):
        scan = ObstacleScanner(camera, mount).scan(np.full((320, 640), nothing, np.float32), level, 5.0)
        assert (scan.state == UNKNOWN).all()

    def test_a_stripe_of_unknown_depth_makes_its_elements_unknown_and_no_others(self, camera, mount, level):
        depth = np.full((320, 640), np.inf, np.float32)
        depth[:, 310:330] = np.nan
        scan = ObstacleScanner(camera, mount).scan(depth, level)
        assert scan.state[element(0)] == UNKNOWN
        assert (scan.state[[element(-10), element(10)]] == CLEAR).all()

    def test_one_unknown_pixel_in_a_hundred_leaves_clear_clear(self, camera, mount, level):
        depth = np.full((320, 640), np.inf, np.float32)
        depth[np.random.default_rng(3).random(depth.shape) < 0.01] = np.nan
        scan = ObstacleScanner(camera, mount).scan(depth, level)
        assert (scan.state[element(-40) : element(40) + 1] == CLEAR).all()

    def test_an_obstacle_amid_unknown_depth_is_an_obstacle(self, camera, mount, level):
        depth = depth_of([wall(7)], camera, mount, level)
        depth[np.random.default_rng(4).random(depth.shape) < 0.6] = np.nan
        scan = ObstacleScanner(camera, mount).scan(depth, level)
        assert scan.distance_m[element(0)] == pytest.approx(7.0, rel=0.03)

    @pytest.mark.parametrize("pitch", [-30, 30])
    def test_looking_away_from_the_flight_level_sees_nothing_clear(self, camera, mount, pitch):
        sky = np.full((320, 640), np.inf, np.float32)
        scan = ObstacleScanner(camera, mount).scan(sky, attitude_deg(pitch=pitch))
        assert (scan.state == UNKNOWN).all()

    def test_the_flight_level_is_seen_wherever_an_element_is_clear(self, camera, mount):
        sky = np.full((320, 640), np.inf, np.float32)
        scanner = ObstacleScanner(camera, mount)
        half_view = math.degrees(math.atan(160 / camera.fy))
        clear_at = [
            pitch
            for pitch in range(-40, 41)
            if scanner.scan(sky, attitude_deg(pitch=pitch)).state[element(0)] == CLEAR
        ]
        assert -20 in clear_at
        assert 20 in clear_at
        assert max(abs(pitch) for pitch in clear_at) < half_view


class TestNoise:
    def test_one_wrong_pixel_in_a_hundred_makes_no_obstacle(self, camera, mount, level):
        rng = np.random.default_rng(5)
        scanner = ObstacleScanner(camera, mount)
        for nearest, farthest in ((0.2, 20.0), (1.0, 1.0), (3.0, 6.0)):
            depth = depth_of([ground(6)], camera, mount, level)
            salt = rng.random(depth.shape) < 0.01
            depth[salt] = rng.uniform(nearest, farthest, salt.sum())
            scan = scanner.scan(depth, level, 6.0)
            assert obstacles(scan) == []
            assert (scan.state[element(-40) : element(40) + 1] == CLEAR).all()

    def test_a_thin_pole_stays_in_noise(self, camera, mount, level):
        rng = np.random.default_rng(6)
        scanner = ObstacleScanner(camera, mount)
        true = depth_of([pole(11, 6.0, 0.02), ground(5)], camera, mount, level)
        for _ in range(20):
            depth = true.copy()
            salt = rng.random(depth.shape) < 0.01
            depth[salt] = rng.uniform(0.2, 20.0, salt.sum())
            scan = scanner.scan(depth, level, 5.0)
            assert obstacles(scan) == [element(10)]
            assert scan.nearest_m == pytest.approx(6.0, rel=0.05)

    def test_flicker_of_twenty_percent_moves_the_nearest_by_less_than_ten(self, camera, mount, level):
        rng = np.random.default_rng(7)
        scanner = ObstacleScanner(camera, mount)
        true = depth_of([wall(8), ground(5)], camera, mount, level)
        nearest = []
        for _ in range(20):
            depth = true * rng.uniform(0.8, 1.2, true.shape).astype(np.float32)
            nearest.append(scanner.scan(depth, level, 5.0).nearest_m)
        assert max(nearest) / min(nearest) < 1.1
        assert 0.75 * 8 < min(nearest) <= max(nearest) < 1.05 * 8

    def test_noise_on_a_wall_does_not_bring_it_much_nearer(self, camera, mount, level):
        depth = depth_of([wall(8)], camera, mount, level)
        depth *= np.random.default_rng(8).normal(1.0, 0.05, depth.shape).astype(np.float32)
        scan = ObstacleScanner(camera, mount).scan(depth, level)
        assert 0.87 * 8 < scan.distance_m[element(0)] <= 8

    def test_a_speck_the_size_of_a_fingernail_is_no_obstacle(self, camera, mount, level):
        depth = np.full((320, 640), np.inf, np.float32)
        depth[100:105, 320:325] = 1.0
        assert obstacles(ObstacleScanner(camera, mount).scan(depth, level)) == []


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
