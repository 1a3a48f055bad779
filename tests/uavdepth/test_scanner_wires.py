"""What is thin and goes on is an obstacle, however little of it shows; what is caution is told nearer."""

from __future__ import annotations

import numpy as np
import pytest
from elements import attitude_deg, element, obstacles
from solids import depth_of, ground, pole, wall, wire

from uavdepth import CameraMount, ImageSizeError, ObstacleScanner, ScanError, SectorState

OBSTACLE, CLEAR, UNKNOWN = SectorState.OBSTACLE, SectorState.CLEAR, SectorState.UNKNOWN


class TestWires:
    @pytest.mark.parametrize("distance", [1.5, 3.0, 6.0, 10.0])
    def test_r13_a_wire_of_one_pixel_across_the_way_stays(self, camera, mount, level, distance):
        line = wire((distance, -30, 0.3), (distance, 30, 0.4), 1.1 * distance / camera.fx)
        depth = depth_of([line, ground(6)], camera, mount, level)
        assert 1 <= (depth[:, 300:340] < 1.2 * distance).sum(axis=0).mean() < 2
        scan = ObstacleScanner(camera, mount).scan(depth, level, 6.0)
        assert scan.distance_m[element(0)] == pytest.approx(distance, rel=0.03)
        assert {element(-20), element(0), element(20)} <= set(obstacles(scan))

    @pytest.mark.parametrize("aside_deg", [-40, 25])
    def test_a_cable_aslant_stays_for_a_vehicle_that_leans(self, camera, aside_deg):
        mount, attitude = CameraMount(pitch_deg=-10), attitude_deg(roll=12, pitch=5)
        direction = 30 * np.array([np.sin(np.radians(aside_deg)), np.cos(np.radians(aside_deg)), 0.08])
        middle = np.array([2.5, 0.0, -0.3])
        cable = wire(middle - direction, middle + direction, 0.024)
        scan = ObstacleScanner(camera, mount).scan(
            depth_of([cable, ground(6)], camera, mount, attitude), attitude, 6.0
        )
        assert scan.distance_m[element(0)] == pytest.approx(2.5, rel=0.06)

    def test_r13_a_wire_in_noise_and_flicker_stays(self, camera, mount, level):
        rng = np.random.default_rng(12)
        true = depth_of([wire((3, -30, 0), (3, 30, 0.2), 0.015), ground(6)], camera, mount, level)
        scanner = ObstacleScanner(camera, mount)
        told = []
        for _ in range(10):
            depth = true * rng.uniform(0.8, 1.2, true.shape).astype(np.float32)
            salt = rng.random(depth.shape) < 0.01
            depth[salt] = rng.uniform(0.2, 20.0, salt.sum())
            told.append(scanner.scan(depth, level, 6.0).distance_m[element(0)])
        # Of the few pixels that a wire has, all flicker: a fifth is what it may be off.
        assert 0.8 * 3 < min(told) <= max(told) < 1.2 * 3

    def test_a_short_stroke_of_noise_is_no_wire(self, camera, mount, level):
        depth = depth_of([ground(6)], camera, mount, level)
        depth[100, 310:350] = 2.0  # one and a half elements
        assert obstacles(ObstacleScanner(camera, mount).scan(depth, level, 6.0)) == []

    def test_r13_salt_at_one_distance_is_no_wire(self, camera, mount, level):
        rng = np.random.default_rng(13)
        scanner = ObstacleScanner(camera, mount)
        for _ in range(10):
            depth = depth_of([ground(6)], camera, mount, level)
            depth[rng.random(depth.shape) < 0.01] = rng.choice([1.0, 2.0, 4.0])
            assert obstacles(scanner.scan(depth, level, 6.0)) == []


class TestCaution:
    def test_an_obstacle_is_told_nearer_by_its_doubt(self, camera, mount, level):
        depth = depth_of([wall(8)], camera, mount, level)
        for factor, sigma in ((1.0, 0.1), (2.0, 0.1), (0.5, 0.3), (0.0, 0.3)):
            scan = ObstacleScanner(camera, mount, sigma_factor=factor).scan(
                depth, level, None, np.full(depth.shape, sigma, np.float32)
            )
            assert scan.distance_m[element(0)] == pytest.approx(8 * (1 - factor * sigma), rel=0.03)

    @pytest.mark.parametrize("sigma", [0.9, 5.0, np.inf, np.nan])
    def test_a_near_thing_stays_an_obstacle_however_doubtful(self, camera, mount, level, sigma):
        depth = depth_of([pole(0, 4.0, 0.1), wall(15)], camera, mount, level)
        scan = ObstacleScanner(camera, mount).scan(depth, level, None, np.full(depth.shape, sigma))
        assert scan.state[element(0)] == OBSTACLE
        assert scan.distance_m[element(0)] == pytest.approx(0.75 * 4.0, rel=0.05)

    @pytest.mark.parametrize("sigma", [0.05, 0.2])
    def test_far_and_certain_is_clear(self, camera, mount, level, sigma):
        scan = ObstacleScanner(camera, mount).scan(*self.far_wall(camera, mount, level, sigma))
        assert scan.state[element(0)] == CLEAR  # 30 m, and 24 m at the least

    @pytest.mark.parametrize("factor", [0.125, 0.5, 2.0])
    def test_a_little_beyond_and_perhaps_within_reach_is_told(self, camera, mount, level, factor):
        scanner = ObstacleScanner(camera, mount, sigma_factor=factor)
        scan = scanner.scan(*self.far_wall(camera, mount, level, 0.4, 24.0))
        assert scan.state[element(0)] == OBSTACLE
        # Shortened by 0.05, 0.2 and a quarter; the first ends beyond maximum distance: just within it.
        told_m = {0.125: 19.98, 0.5: 0.8 * 24.0, 2.0: 0.75 * 24.0}[factor]
        assert scan.distance_m[element(0)] == pytest.approx(told_m, rel=0.02)

    @pytest.mark.parametrize("factor", [0.25, 0.75, 2.0])
    def test_far_beyond_and_perhaps_within_reach_is_unknown(self, camera, mount, level, factor):
        scanner = ObstacleScanner(camera, mount, sigma_factor=factor)
        scan = scanner.scan(*self.far_wall(camera, mount, level, 0.4))
        assert scan.state[element(0)] == UNKNOWN  # 30 m, and 18 m at the least: no obstacle, and not clear

    def test_a_little_beyond_is_told_where_it_may_begin(self, camera, mount, level):
        depth = depth_of([wall(21)], camera, mount, level)
        scan = ObstacleScanner(camera, mount, sigma_factor=1.0).scan(
            depth, level, None, np.full(depth.shape, 0.4)
        )
        assert scan.distance_m[element(0)] == pytest.approx(0.75 * 21.0, rel=0.03)

    @pytest.mark.parametrize("factor", [0.1, 0.25, 1.0, 1.5])
    def test_a_way_is_freed_by_one_deviation_or_as_many_as_shorten(self, camera, mount, level, factor):
        scanner = ObstacleScanner(camera, mount, sigma_factor=factor)
        limit = (1 - 20 / 24) / max(1.0, factor)  # doubt at which a wall at 24 m may begin at 20 m
        for sigma, state in ((0.9 * limit, CLEAR), (1.1 * limit, OBSTACLE)):
            scan = scanner.scan(*self.far_wall(camera, mount, level, sigma, 24.0))
            assert scan.state[element(0)] == state

    def test_without_caution_doubt_closes_no_way(self, camera, mount, level):
        scanner = ObstacleScanner(camera, mount, sigma_factor=0.0)
        scan = scanner.scan(*self.far_wall(camera, mount, level, 0.45, 24.0))
        assert scan.state[element(0)] == CLEAR

    @pytest.mark.parametrize("sigma", [0.51, 1.0, 3.0, np.inf, np.nan])
    def test_far_and_too_doubtful_to_tell_is_unknown(self, camera, mount, level, sigma):
        scan = ObstacleScanner(camera, mount).scan(*self.far_wall(camera, mount, level, sigma))
        assert scan.state[element(0)] == UNKNOWN

    @staticmethod
    def far_wall(camera, mount, level, sigma, distance_m=30.0):
        depth = depth_of([wall(distance_m)], camera, mount, level)
        return depth, level, None, np.full(depth.shape, sigma, np.float32)

    def test_doubtful_ground_is_not_clear_and_no_obstacle(self, camera, level):
        mount = CameraMount(pitch_deg=-15)
        depth = depth_of([ground(2.0)], camera, mount, level)
        scanner = ObstacleScanner(camera, mount)
        sure = scanner.scan(depth, level, 2.0, np.full(depth.shape, 0.05))
        doubtful = scanner.scan(depth, level, 2.0, np.full(depth.shape, 0.6))
        assert sure.state[element(0)] == CLEAR
        assert doubtful.state[element(0)] == UNKNOWN
        assert obstacles(doubtful) == []

    def test_doubt_of_one_half_of_the_picture_leaves_the_other_as_it_is(self, camera, mount, level):
        depth = depth_of([wall(30)], camera, mount, level)
        sigma = np.full(depth.shape, 0.05, np.float32)
        sigma[:, 320:] = 0.9
        scan = ObstacleScanner(camera, mount).scan(depth, level, None, sigma)
        assert scan.state[element(-20)] == CLEAR
        assert scan.state[element(20)] == UNKNOWN

    def test_impossible_caution_is_refused(self, camera, mount, level):
        for factor in (-0.1, 5.1, np.nan):
            with pytest.raises(ScanError, match=f"sigma_factor is {factor}"):
                ObstacleScanner(camera, mount, sigma_factor=factor)
        with pytest.raises(ImageSizeError, match="uncertainty's shape"):
            ObstacleScanner(camera, mount).scan(np.ones((320, 640)), level, None, np.ones((3, 3)))
