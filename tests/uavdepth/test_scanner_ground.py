"""Ground is no obstacle, and what stands on it is."""

from __future__ import annotations

import math

import cv2
import numpy as np
import pytest
from elements import attitude_deg, element, obstacles
from solids import box, depth_of, ground, smooth_noise, wall

from uavdepth import (
    ObstacleScanner,
)


class TestGround:
    @pytest.mark.parametrize("known_height", [True, False], ids=["height known", "height not known"])
    def test_r1_flat_ground_is_never_an_obstacle(self, camera, mount, known_height):
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
    def test_r2_a_small_box_on_the_ground_is_an_obstacle(self, camera, mount, level, height):
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
