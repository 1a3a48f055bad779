"""Points from motion on a real drive: metres from the vehicle's speed, against its LiDAR."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from training.sequences.kitti_raw import KittiDrive, open_kitti_raw
from training.sequences.oxts import Oxts
from uavdepth import Attitude, CameraMount, PointHints
from uavdepth.motion.motion_points import MotionPoints
from uavdepth.motion.vehicle_motion import VehicleMotion

KITTI = Path(__file__).parents[2].parent / "shared" / "data" / "kitti_raw"


def exposures_ns(drive: KittiDrive) -> list[int]:
    """Times of the pictures since the first: KITTI's cameras make one in 0.1035 s, not in 0.1 s."""
    lines = (drive.file_of(0).parents[1] / "timestamps.txt").read_text(encoding="ascii").split()
    seconds = [np.dot([3600, 60, 1], [float(part) for part in line.split(":")]) for line in lines[1::2]]
    return [round((each - seconds[0]) * 1e9) for each in seconds]


def flown(oxts: Oxts) -> tuple[Attitude, NDArray[np.float64]]:
    """Attitude and velocity against NED of a record that is against east, north, up."""
    yaw_rad = math.remainder(math.pi / 2 - oxts.yaw_rad, 2 * math.pi)
    attitude = Attitude(oxts.roll_rad, -oxts.pitch_rad, yaw_rad)
    body = np.array([oxts.forward_m_s, -oxts.left_m_s, -oxts.up_m_s])
    return attitude, attitude.ned_from_body @ body


def errors(found: PointHints, lidar_m: NDArray[np.float32]) -> NDArray[np.float64]:
    """Relative errors of the points that lie on a surface that the LiDAR has hit all around."""
    wrong = []
    for (column, row), depth_m in zip(np.rint(found.pixels).astype(int), found.depth_m, strict=True):
        hits = lidar_m[max(row - 2, 0) : row + 3, max(column - 1, 0) : column + 2]
        hits = hits[np.isfinite(hits)]
        if hits.size and hits.max() < 1.1 * hits.min():
            wrong.append(depth_m / np.median(hits) - 1)
    return np.array(wrong)


@pytest.mark.skipif(not KITTI.is_dir(), reason="KITTI's raw drive is not on this machine")
def test_a_car_s_speed_gives_metres() -> None:
    drive = open_kitti_raw(KITTI)[0]
    motion, points = VehicleMotion(), MotionPoints(drive.camera, CameraMount())
    position, last_ns, wrong = np.zeros(3), 0, []
    for number, at_ns in enumerate(exposures_ns(drive)[: len(drive)]):
        oxts = drive.oxts(number)
        assert oxts is not None
        attitude, velocity = flown(oxts)
        position = position + velocity * (at_ns - last_ns) * 1e-9
        last_ns = at_ns
        motion.add_attitude(at_ns, attitude)
        motion.add_position(at_ns, position, velocity)
        found = points.update(drive.image_bgr(number), at_ns, motion)
        lidar_m = drive.truth_m(number)
        assert lidar_m is not None
        wrong.append(errors(found, lidar_m))
    every = np.concatenate(wrong)
    assert every.size > 150
    assert np.median(np.abs(every)) < 0.04
    assert abs(np.median(every)) < 0.03
