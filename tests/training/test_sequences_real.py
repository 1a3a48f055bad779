"""Real KITTI pictures, where they are there: geometry that only the real calibration can get right."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from training.sequences.calibration import Calibration
from training.sequences.garg_crop import garg_mask
from training.sequences.kitti_odometry import open_kitti_odometry
from training.sequences.kitti_raw import open_kitti_raw
from training.sequences.opening import open_triplets

DATA = Path(__file__).parents[3] / "shared" / "data"

pytestmark = pytest.mark.skipif(
    not DATA.is_dir(), reason="KITTI samples (../shared/data) are not part of the project"
)


def test_lidar_on_the_road_ahead_is_as_deep_as_flat_ground_under_the_camera() -> None:
    """The cameras are 1.65 m above the road (Geiger et al. 2013)."""
    drive = open_kitti_raw(DATA / "kitti_raw")[0]
    camera = drive.camera
    rows, columns = np.indices((camera.height, camera.width))
    road = (rows > 300) & (np.abs(columns - camera.cx) < 150)
    flat = 1.65 * camera.fy / (rows - camera.cy)[road]
    ratios = []
    for index in range(len(drive)):
        truth = drive.truth_m(index)
        assert truth is not None
        measured = truth[road]
        known = np.isfinite(measured)
        assert known.sum() > 500
        ratios.append(float(np.median(measured[known] / flat[known])))
        assert np.isfinite(truth[garg_mask(*truth.shape)]).sum() > 10_000
    # The car nods by half a degree: single frames are off by some percent, not their mean.
    assert ratios == pytest.approx([1.0] * len(drive), abs=0.08)
    assert np.mean(ratios) == pytest.approx(1.0, abs=0.03)


def test_both_cameras_see_lidar_points_half_a_metre_apart() -> None:
    left, right = open_kitti_raw(DATA / "kitti_raw")
    assert left.image_from_lidar is not None
    assert right.image_from_lidar is not None
    ahead = np.array([10.0, 0.0, 0.0, 1.0])
    (ul, _, zl), (ur, _, zr) = (each.image_from_lidar @ ahead for each in (left, right))
    assert 10.0 * (ul / zl - ur / zr) / left.camera.fx == pytest.approx(0.532, abs=0.02)


def test_the_car_drives_forward_at_the_speed_that_navigation_says() -> None:
    drive = open_kitti_raw(DATA / "kitti_raw")[0]
    motions = [drive.oxts(index) for index in range(len(drive))]
    assert all(motion is not None and 5.0 < motion.forward_m_s < 15.0 for motion in motions)
    assert all(motion is not None and abs(motion.left_m_s) < 0.3 for motion in motions)


def test_odometry_poses_move_forward_about_a_metre_a_frame() -> None:
    for sequence in open_kitti_odometry(DATA / "kitti_odometry"):
        poses = [sequence.world_from_camera(index) for index in range(len(sequence))]
        steps = [np.linalg.inv(a) @ b for a, b in pairwise(poses)]
        forward = np.array([step[2, 3] for step in steps])
        assert len(sequence) == 51
        assert forward.mean() == pytest.approx(1.1, abs=0.15)
        assert all(abs(step[0, 3]) < 0.1 * step[2, 3] for step in steps)


def test_consecutive_pictures_make_triplets() -> None:
    camera = open_kitti_raw(DATA / "kitti_raw")[0].camera
    assert len(open_triplets("kitti-raw", DATA / "kitti_raw")) == 16
    assert len(open_triplets("folder", DATA / "kitti_motion", Calibration(camera))) == 89


def test_a_real_video_gives_all_its_frames() -> None:
    triplets = open_triplets("video", DATA / "road_video", Calibration(horizontal_fov_deg=60.0))
    assert len(triplets) == 219
    assert triplets.triplets[0].sequence.camera.width == 960
