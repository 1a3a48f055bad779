"""Points from motion in a rendered street, with an autopilot that errs as real ones do."""

from __future__ import annotations

import math

import numpy as np
import pytest

from uavdepth import Attitude, CameraModel, CameraMount
from uavdepth.motion_points import MotionPoints
from uavdepth.vehicle_motion import VehicleMotion

pytest.importorskip("embreex", reason="rendered worlds need the extra sim")

FRAMES = 9


def test_points_5_to_30_m_away_are_within_5_percent() -> None:
    from uavdepth.scenes import load_scene

    camera, mount = CameraModel.from_fov(640, 320, 90), CameraMount(pitch_deg=-5.0)
    scene = load_scene("city", 1000)
    flight = scene.flight(3, 8.0)
    rng = np.random.default_rng(2)
    motion, points = VehicleMotion(), MotionPoints(camera, mount)
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
    column, row = np.rint(found.pixels).astype(int).T
    truth = picture.depth_m[row, column]
    meant = (truth >= 5) & (truth <= 30)
    error = np.abs(found.depth_m / truth - 1)[meant]
    assert meant.sum() > 60
    assert np.median(error) < 0.05
    assert np.mean(error < found.relative_sigma[meant]) > 0.5
    assert np.mean(error < 4 * found.relative_sigma[meant]) > 0.9
