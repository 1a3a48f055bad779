"""Metres from the ground plane: right where ground is seen, silent where it is not."""

from __future__ import annotations

import math

import numpy as np
import pytest
from solids import box, depth_of, ground, pole, smooth_noise, wall

from uavdepth import Attitude, CameraModel, CameraMount, GroundScaler, ImageSizeError, vertical_height_m

CARS = [box((5 + 3 * i, -6 + 3.2 * i, 1.5), (8 + 3 * i, -3.5 + 3.2 * i, 3.0)) for i in range(4)]


def slope(camera: CameraModel, height_m: float, rise: float) -> np.ndarray:
    """Depth of a plane through the point `height_m` below a level camera that rises ahead by `rise`."""
    down = camera.normalized_rays[..., 1].astype(np.float64) + rise
    with np.errstate(divide="ignore"):
        return np.where(down > 0, height_m / down, np.inf).astype(np.float32)


class TestFactor:
    @pytest.mark.parametrize("true_factor", [1e-4, 0.05, 0.4, 1.0, 2.5, 20.0, 5000.0])
    @pytest.mark.parametrize("height", [0.8, 3.0, 15.0])
    def test_bare_ground_gives_the_factor(self, camera, mount, level, true_factor, height):
        network = depth_of([ground(height)], camera, mount, level) / true_factor
        scale = GroundScaler(camera, mount).estimate(network, level, height)
        assert scale.factor == pytest.approx(true_factor, rel=0.01)
        assert scale.relative_sigma < 0.05
        assert scale.pixels > 1000

    @pytest.mark.parametrize("pitch_deg", [-25, -10, 10])
    @pytest.mark.parametrize("roll_deg", [-25, 0, 25])
    def test_attitude_mount_and_lever_arm_are_honoured(self, camera, pitch_deg, roll_deg):
        mount = CameraMount(pitch_deg=-8, yaw_deg=10, forward_m=0.5, down_m=0.2)
        attitude = Attitude(math.radians(roll_deg), math.radians(pitch_deg), 2.0)
        network = depth_of([ground(2.0)], camera, mount, attitude) / 3.0
        scale = GroundScaler(camera, mount).estimate(network, attitude, 2.0)
        assert scale.factor == pytest.approx(3.0, rel=0.01)

    @pytest.mark.parametrize(
        "things",
        [
            [wall(9.0)],
            CARS,
            [box((2, -60, -20), (60, 0.5, 3.0))],
            [pole(bearing, 6, 0.3) for bearing in range(-40, 45, 10)],
        ],
        ids=["wall ahead", "parked cars", "house on the left", "row of poles"],
    )
    def test_things_on_half_of_the_ground_do_not_move_it(self, camera, mount, level, things):
        network = depth_of([ground(3.0), *things], camera, mount, level) / 1.7
        scale = GroundScaler(camera, mount).estimate(network, level, 3.0)
        assert scale.factor == pytest.approx(1.7, rel=0.02)

    def test_cars_hide_half_of_the_ground_in_that_test(self, camera, mount, level):
        bare = depth_of([ground(3.0)], camera, mount, level)
        with_house = depth_of([ground(3.0), box((2, -60, -20), (60, 0.5, 3.0))], camera, mount, level)
        lower = np.isfinite(bare)
        assert (with_house < bare)[lower].mean() > 0.5

    def test_a_networks_errors_stay_within_the_sigma_it_tells(self, camera, mount, level):
        rng = np.random.default_rng(1)
        scaler = GroundScaler(camera, mount)
        deviations = []
        for _ in range(20):
            network = depth_of([ground(3.0), *CARS], camera, mount, level)
            network *= smooth_noise(rng, network.shape, 0.1)
            scale = scaler.estimate(network, level, 3.0)
            deviations.append(abs(math.log(scale.factor)) / scale.relative_sigma)
            assert scale.factor == pytest.approx(1.0, rel=0.12)
        assert np.mean(np.array(deviations) < 2.0) >= 0.9

    def test_unknown_and_endless_pixels_are_left_out(self, camera, mount, level):
        network = depth_of([ground(3.0)], camera, mount, level)
        network[np.random.default_rng(3).random(network.shape) < 0.5] = np.nan
        network[200:220] = np.inf
        network[220:240] = 0.0
        assert GroundScaler(camera, mount).estimate(network, level, 3.0).factor == pytest.approx(
            1.0, rel=0.01
        )


class TestDoubt:
    @pytest.mark.parametrize("height", [None, math.nan, math.inf, -2.0, 0.0, 0.29])
    def test_without_a_height_there_are_no_metres(self, camera, mount, level, height):
        network = depth_of([ground(3.0)], camera, mount, level)
        assert GroundScaler(camera, mount).estimate(network, level, height) is None

    @pytest.mark.parametrize("pitch_deg", [-30, -15, 0, 10])
    @pytest.mark.parametrize("distance", [2.0, 4.0])
    def test_a_wall_that_hides_the_ground_gives_none(self, camera, mount, pitch_deg, distance):
        attitude = Attitude(0.0, math.radians(pitch_deg), 0.0)
        network = depth_of([wall(distance)], camera, mount, attitude)
        assert GroundScaler(camera, mount).estimate(network, attitude, 6.0) is None

    def test_a_camera_that_looks_up_gives_none(self, camera, mount):
        attitude = Attitude(0.0, math.radians(40), 0.0)
        network = np.full((320, 640), 10.0, np.float32)
        assert GroundScaler(camera, mount).estimate(network, attitude, 3.0) is None

    def test_two_levels_that_share_the_picture_give_none(self, camera, mount, level):
        # A quay: water 6 m down on the left, the quay 3 m down on the right.
        left = depth_of([ground(6.0)], camera, mount, level)
        right = depth_of([ground(3.0)], camera, mount, level)
        network = np.where(np.arange(640) < 320, left, right)
        assert GroundScaler(camera, mount).estimate(network, level, 3.0) is None

    def test_scattered_depth_gives_none(self, camera, mount, level):
        rng = np.random.default_rng(2)
        network = depth_of([ground(3.0)], camera, mount, level)
        network *= np.exp(rng.normal(0, 1.5, network.shape)).astype(np.float32)
        assert GroundScaler(camera, mount).estimate(network, level, 3.0) is None

    @pytest.mark.parametrize("value", [np.nan, np.inf, 0.0, -1.0])
    def test_a_picture_without_depth_gives_none(self, camera, mount, level, value):
        network = np.full((320, 640), value, np.float32)
        assert GroundScaler(camera, mount).estimate(network, level, 3.0) is None

    @pytest.mark.parametrize("rise", [-0.25, -0.15, 0.25])
    def test_a_steep_slope_gives_none(self, camera, mount, level, rise):
        assert GroundScaler(camera, mount).estimate(slope(camera, 3.0, rise), level, 3.0) is None

    @pytest.mark.parametrize("rise", [-0.06, -0.03, 0.03, 0.06])
    def test_the_error_of_a_gentle_slope_is_within_two_of_the_sigma_it_tells(
        self, camera, mount, level, rise
    ):
        scale = GroundScaler(camera, mount).estimate(slope(camera, 3.0, rise), level, 3.0)
        assert abs(math.log(scale.factor)) < 2 * scale.relative_sigma

    def test_a_valley_floor_is_not_taken_for_the_ground_where_factors_must_be_plausible(
        self, camera, mount, level
    ):
        network = depth_of([ground(20.0)], camera, mount, level)
        anything, metric = GroundScaler(camera, mount), GroundScaler(camera, mount, plausible=(0.5, 2.0))
        assert anything.estimate(network, level, 5.0).factor == pytest.approx(0.25, rel=0.01)
        assert metric.estimate(network, level, 5.0) is None
        assert metric.estimate(network, level, 18.0).factor == pytest.approx(0.9, rel=0.01)

    @pytest.mark.parametrize("plausible", [(0.0, 1.0), (2.0, 1.0), (math.nan, 1.0)])
    def test_plausible_factors_that_exclude_all_are_refused(self, camera, mount, plausible):
        with pytest.raises(ValueError, match="plausible factors are"):
            GroundScaler(camera, mount, plausible=plausible)

    def test_depth_of_another_size_is_refused(self, camera, mount, level):
        with pytest.raises(ImageSizeError, match=r"\(10, 10\).*\(320, 640\)"):
            GroundScaler(camera, mount).estimate(np.ones((10, 10), np.float32), level, 3.0)


def test_a_tilted_rangefinder_reads_too_long():
    attitude = Attitude(math.radians(20), math.radians(-15), 1.0)
    down_in_body = attitude.level_from_body.T @ np.array([0.0, 0.0, 1.0])
    slant = 5.0 / down_in_body[2]
    assert vertical_height_m(slant, attitude) == pytest.approx(5.0)
