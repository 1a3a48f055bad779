"""Ground that slopes is ground until it is in the way, and what stands on it is not."""

from __future__ import annotations

import math

import numpy as np
import pytest
from elements import attitude_deg, element, obstacles
from solids import box, depth_of, ground, slope, smooth_noise, turned, wall

from uavdepth import CameraMount, ObstacleScanner, ScanError, SectorState
from uavdepth.scan.sloping_ground import FLIGHT_CLEARANCE_M


def too_near_m(height: float, rise_deg: float) -> float:
    """Where a slope comes to the flight level, less the clearance."""
    return (height - FLIGHT_CLEARANCE_M) / math.tan(math.radians(rise_deg))


@pytest.fixture
def nose_down():
    return CameraMount(pitch_deg=-10)


class TestGround:
    @pytest.mark.parametrize("rise_deg", [4, 8, 12, 15])
    @pytest.mark.parametrize("height", [1.5, 3.0, 6.0])
    def test_r1_a_slope_ahead_is_ground_until_it_comes_to_the_flight_level(
        self, camera, nose_down, level, height, rise_deg
    ):
        depth = depth_of([slope(height, rise_deg)], camera, nose_down, level)
        scan = ObstacleScanner(camera, nose_down).scan(depth, level, height)
        far = too_near_m(height, rise_deg)
        if far > 20:
            assert obstacles(scan) == []
        else:
            assert scan.distance_m[element(0)] == pytest.approx(far, rel=0.12)

    def test_r1_slopes_in_every_direction_and_attitude_are_no_obstacle(self, camera):
        rng = np.random.default_rng(10)
        for _ in range(15):
            mount = CameraMount(pitch_deg=float(rng.choice([0, -10, -20])))
            height, rise_deg = float(rng.uniform(4, 8)), float(rng.uniform(0, 11))
            attitude = attitude_deg(rng.uniform(-25, 25), rng.uniform(-25, 15))
            hill = turned(slope(height, rise_deg), rng.uniform(-180, 180))
            scan = ObstacleScanner(camera, mount).scan(
                depth_of([hill], camera, mount, attitude), attitude, height
            )
            limit = too_near_m(height, rise_deg)
            assert limit > 19 or (scan.distance_m[obstacles(scan)] > 0.93 * limit).all(), (height, rise_deg)
            assert limit < 20 or obstacles(scan) == [], f"{height} m, {rise_deg} deg, {attitude}"

    def test_ground_that_begins_to_rise_at_some_distance_is_ground(self, camera, nose_down, level):
        depth = depth_of([slope(3.0, 10, from_m=5.0)], camera, nose_down, level)
        scan = ObstacleScanner(camera, nose_down).scan(depth, level, 3.0)
        assert scan.distance_m[element(0)] == pytest.approx(5 + too_near_m(3.0, 10), rel=0.12)

    def test_a_slope_with_a_networks_errors_is_ground(self, camera, nose_down, level):
        rng = np.random.default_rng(11)
        true = depth_of([slope(5.0, 8)], camera, nose_down, level)
        for _ in range(5):
            depth = true * smooth_noise(rng, true.shape, 0.04)
            assert obstacles(ObstacleScanner(camera, nose_down).scan(depth, level, 5.0)) == []

    def test_a_hillside_steeper_than_the_setting_is_an_obstacle(self, camera, nose_down, level):
        depth = depth_of([slope(3.0, 25, from_m=4.0)], camera, nose_down, level)
        nearest = ObstacleScanner(camera, nose_down).scan(depth, level, 3.0).nearest_m
        assert nearest < 4.0 + too_near_m(3.0, 25) - 0.8
        gentle = depth_of([slope(3.0, 10, from_m=4.0)], camera, nose_down, level)
        strict = ObstacleScanner(camera, nose_down, max_ground_slope_deg=0).scan(gentle, level, 3.0)
        assert strict.nearest_m == pytest.approx(9.67, rel=0.02), "where it comes into the height band"
        with pytest.raises(ScanError, match="max_ground_slope_deg is 26"):
            ObstacleScanner(camera, nose_down, max_ground_slope_deg=26)


class TestThings:
    @pytest.mark.parametrize("rise_deg", [0, 6, 12])
    @pytest.mark.parametrize(
        ("long_m", "wide_m", "tall_m"),
        [(0.3, 8.0, 6.0), (4.0, 2.2, 1.5), (0.8, 6.0, 1.2), (0.5, 0.5, 0.9)],
        ids=["wall", "car", "hedge", "box"],
    )
    def test_a_slope_swallows_nothing_that_stands_on_it(
        self, camera, nose_down, level, rise_deg, long_m, wide_m, tall_m
    ):
        for distance in (4.0, 6.0):
            foot = 2.2 - math.tan(math.radians(rise_deg)) * distance
            thing = box((distance, -wide_m / 2, foot - tall_m), (distance + long_m, wide_m / 2, 3))
            depth = depth_of([slope(2.2, rise_deg), thing], camera, nose_down, level)
            scan = ObstacleScanner(camera, nose_down).scan(depth, level, 2.2)
            assert scan.state[element(0)] == SectorState.OBSTACLE
            assert scan.distance_m[element(0)] < 1.12 * distance

    @pytest.mark.parametrize("height", [2.0, None])
    def test_r2_a_small_box_is_an_obstacle_for_a_camera_that_looks_down(
        self, camera, nose_down, level, height
    ):
        things = [ground(2.0), box((5, -0.25, 1.5), (5.5, 0.25, 2.0))]
        depth = depth_of(things, camera, nose_down, level)
        scan = ObstacleScanner(camera, nose_down).scan(depth, level, height)
        assert element(0) in obstacles(scan)
        assert scan.distance_m[element(0)] == pytest.approx(5.0, rel=0.03)

    @pytest.mark.parametrize("right_m", [-1.5, 0.0, 1.5])
    def test_a_car_whose_foot_is_not_seen_is_no_slope(self, camera, nose_down, level, right_m):
        """Bonnet, windscreen and roof from 0.9 to 1.4 m: as a slope of 15 degrees would rise."""
        height, left, right = 2.65, right_m - 0.95, right_m + 0.95
        parts = [(2.6, 3.7, 0.9), (3.7, 3.95, 1.05), (3.95, 4.2, 1.25), (4.2, 6.0, 1.4)]
        car = [box((near, left, height - tall), (far, right, height)) for near, far, tall in parts]
        depth = depth_of([ground(height), *car], camera, nose_down, level)
        scan = ObstacleScanner(camera, nose_down).scan(depth, level, height)
        ahead = element(math.degrees(math.atan2(right_m, 3.7)))
        assert scan.state[ahead] == SectorState.OBSTACLE
        assert scan.distance_m[ahead] < 4.2

    def test_a_hillside_beside_a_gorge_is_ground(self, camera, nose_down, level):
        hill, gorge = slope(3.0, 10), ground(9.0)
        left, gone = (depth_of([thing], camera, nose_down, level) for thing in (hill, gorge))
        depth = np.where(np.arange(camera.width) < camera.width // 2, left, gone)
        scan = ObstacleScanner(camera, nose_down).scan(depth, level, 3.0)
        assert scan.nearest_m == pytest.approx(too_near_m(3.0, 10), rel=0.12)

    def test_a_kerb_that_stands_in_the_band_is_an_obstacle_from_low_down(self, camera, nose_down, level):
        kerb = box((3, -5, 0.65), (3.3, 5, 1.0))  # 35 cm, seen from 1 m
        depth = depth_of([ground(1.0), kerb], camera, nose_down, level)
        scan = ObstacleScanner(camera, nose_down).scan(depth, level, 1.0)
        assert scan.distance_m[element(0)] == pytest.approx(3.0, rel=0.05)

    def test_the_foot_of_a_wall_that_is_not_seen_does_not_make_a_slope_of_it(self, camera, mount, level):
        for distance in (1.5, 2.5, 3.5):
            depth = depth_of([ground(3.0), wall(distance)], camera, mount, level)
            scan = ObstacleScanner(camera, mount).scan(depth, level, 3.0)
            assert scan.distance_m[element(0)] == pytest.approx(distance, rel=0.03)

    def test_a_platform_that_hides_the_ground_before_it_is_not_ground(self, camera, mount, level):
        platform = box((2.0, -6, 1.3), (9, 6, 3.0))
        scan = ObstacleScanner(camera, mount).scan(
            depth_of([ground(3.0), platform], camera, mount, level), level, 3.0
        )
        assert scan.nearest_m < 3.0
