"""Nothing is clear that was not seen, and noise is no obstacle."""

from __future__ import annotations

import math

import numpy as np
import pytest
from elements import attitude_deg, element, obstacles
from solids import depth_of, ground, pole, wall

from uavdepth import CameraMount, ObstacleScanner, SectorState

OBSTACLE, CLEAR, UNKNOWN = SectorState.OBSTACLE, SectorState.CLEAR, SectorState.UNKNOWN


class TestDoubt:
    def test_r7_open_sky_and_ground_are_clear_across_the_picture_and_unknown_beside_it(
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

    @pytest.mark.parametrize("bearing", [178.5, -178.5])
    def test_a_pole_on_either_side_of_straight_behind_is_found_and_doubted(self, camera, level, bearing):
        rear = CameraMount(yaw_deg=180.0)
        depth = depth_of([pole(bearing, 6.0, 0.05)], camera, rear, level)
        scanner = ObstacleScanner(camera, rear, sigma_factor=1.0)
        scan = scanner.scan(depth, level, None, np.full_like(depth, 0.25))
        assert obstacles(scan) == [element(180)]
        assert scan.distance_m[element(180)] == pytest.approx(0.75 * 6.0, rel=0.03)

    def test_r7_unknown_depth_is_unknown(self, camera, mount, level):
        scan = ObstacleScanner(camera, mount).scan(np.full((320, 640), np.nan, np.float32), level, 5.0)
        assert (scan.state == UNKNOWN).all()
        assert np.isnan(scan.distance_m).all()

    @pytest.mark.parametrize("nothing", [0.0, -1.0, -np.inf])
    def test_r6_zero_and_negative_depth_is_unknown(self, camera, mount, level, nothing):
        scan = ObstacleScanner(camera, mount).scan(np.full((320, 640), nothing, np.float32), level, 5.0)
        assert (scan.state == UNKNOWN).all()

    def test_a_stripe_of_unknown_depth_makes_its_elements_unknown_and_no_others(self, camera, mount, level):
        depth = np.full((320, 640), np.inf, np.float32)
        depth[:, 310:330] = np.nan
        scan = ObstacleScanner(camera, mount).scan(depth, level)
        assert scan.state[element(0)] == UNKNOWN
        assert (scan.state[[element(-10), element(10)]] == CLEAR).all()

    @pytest.mark.parametrize("sigma", [1.0, 3.0, 1e6, math.inf, -3.0, math.nan])
    def test_r7_depth_that_may_be_anything_is_not_clear(self, camera, mount, level, sigma):
        """Three standard deviations of 100 % put a far point far behind the camera: that frees no way."""
        far = np.full((320, 640), 1000.0, np.float32)
        scan = ObstacleScanner(camera, mount).scan(far, level, None, np.full_like(far, sigma))
        assert (scan.state == UNKNOWN).all()

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
    def test_r13_one_wrong_pixel_in_a_hundred_makes_no_obstacle(self, camera, mount, level):
        rng = np.random.default_rng(5)
        scanner = ObstacleScanner(camera, mount)
        for nearest, farthest in ((0.2, 20.0), (1.0, 1.0), (3.0, 6.0)):
            depth = depth_of([ground(6)], camera, mount, level)
            salt = rng.random(depth.shape) < 0.01
            depth[salt] = rng.uniform(nearest, farthest, salt.sum())
            scan = scanner.scan(depth, level, 6.0)
            assert obstacles(scan) == []
            assert (scan.state[element(-40) : element(40) + 1] == CLEAR).all()

    def test_r13_a_thin_pole_stays_in_noise(self, camera, mount, level):
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

    def test_r13_flicker_of_twenty_percent_moves_the_nearest_by_less_than_ten(self, camera, mount, level):
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

    def test_r13_a_speck_the_size_of_a_fingernail_is_no_obstacle(self, camera, mount, level):
        depth = np.full((320, 640), np.inf, np.float32)
        depth[100:105, 320:325] = 1.0
        assert obstacles(ObstacleScanner(camera, mount).scan(depth, level)) == []
