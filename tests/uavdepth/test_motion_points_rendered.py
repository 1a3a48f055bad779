"""Points from motion in a rendered street, with an autopilot that errs as real ones do; and the scale."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pytest

from uavdepth import Attitude, CameraModel, CameraMount, DepthMap, PointHints
from uavdepth.motion.motion_points import MotionPoints
from uavdepth.motion.vehicle_motion import VehicleMotion
from uavdepth.scale.estimator import ScaleEstimate, ScaleEstimator

pytest.importorskip("embreex", reason="rendered worlds need the extra sim")

FRAMES = 9
UNIT_M = 4.2


@dataclass(frozen=True)
class Flown:
    """The last picture of 0.9 s of flight.

    Args:
        points: measured.
        truth_m: (H, W) exact depth.
        relative, affine: what the estimator made of depth without its unit, from points alone.
    """

    points: PointHints
    truth_m: np.ndarray
    relative: ScaleEstimate | None
    affine: ScaleEstimate | None


@pytest.fixture(scope="module")
def flown() -> Flown:
    from uavdepth.scenes import load_scene

    camera, mount = CameraModel.from_fov(640, 320, 90), CameraMount(pitch_deg=-5.0)
    scene = load_scene("city", 1000)
    flight = scene.flight(3, 8.0)
    rng = np.random.default_rng(2)
    motion, points = VehicleMotion(), MotionPoints(camera, mount)
    by_factor, by_shape = ScaleEstimator(camera, mount), ScaleEstimator(camera, mount, "affine")
    slow_velocity, slow_attitude = rng.normal(0, 0.08, 3), rng.normal(0, math.radians(0.4), 3)
    for step in range(FRAMES):
        at_ns = round((2.0 + step / 10) * 1e9)
        pose = flight.at(at_ns * 1e-9)
        angles = np.array([pose.attitude.roll_rad, pose.attitude.pitch_rad, pose.attitude.yaw_rad])
        angles += slow_attitude + rng.normal(0, math.radians(0.3), 3)
        motion.add_attitude(at_ns, Attitude(*angles.tolist()))
        velocity = pose.velocity_ned_mps + slow_velocity + rng.normal(0, 0.06, 3)
        motion.add_position(at_ns, pose.position_ned_m + rng.normal(0, 0.03, 3), velocity)
        picture = scene.render(camera, mount, pose.position_ned_m, pose.attitude)
        found = points.update(picture.image_bgr, at_ns, motion)
        far = np.minimum(picture.depth_m, np.float32(300.0))
        relative = by_factor.update(DepthMap(far / np.float32(UNIT_M)), None, found, at_ns)
        affine = by_shape.update(DepthMap.from_affine(np.float32(5.0) / far + 1), None, found, at_ns)
    return Flown(found, picture.depth_m, relative, affine)


def test_points_5_to_30_m_away_are_within_5_percent(flown: Flown) -> None:
    column, row = np.rint(flown.points.pixels).astype(int).T
    truth = flown.truth_m[row, column]
    meant = (truth >= 5) & (truth <= 30)
    error = np.abs(flown.points.depth_m / truth - 1)[meant]
    assert meant.sum() > 60
    assert np.median(error) < 0.05
    assert np.mean(error < flown.points.relative_sigma[meant]) > 0.5
    assert np.mean(error < 4 * flown.points.relative_sigma[meant]) > 0.9


def test_the_scale_of_a_network_without_metres_is_found_within_a_second(flown: Flown) -> None:
    assert flown.relative is not None
    assert flown.relative.factor == pytest.approx(UNIT_M, rel=0.08)
    assert abs(flown.relative.factor / UNIT_M - 1) < 2.5 * flown.relative.relative_sigma
    assert flown.relative.relative_sigma < 0.1


def test_scale_and_shift_of_an_affine_network_are_found_within_a_second(flown: Flown) -> None:
    assert flown.affine is not None
    for depth_m in (6.0, 20.0):
        found = 1 / (flown.affine.scale * (5.0 / depth_m + 1) + flown.affine.shift)
        assert found == pytest.approx(depth_m, rel=0.12)
