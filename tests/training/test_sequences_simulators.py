"""Recordings of AirSim and TartanAir: pictures, depth and poses as their simulators mean them."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from sequence_files import CAMERA, HEADER, picture, write_airsim, write_camera, write_numbers, write_picture

from training.errors import TrainingDataError
from training.sequences.airsim import open_airsim
from training.sequences.calibration import Calibration
from training.sequences.errors import BrokenFrameError
from training.sequences.pfm import write_pfm
from training.sequences.tartanair import open_tartanair
from training.sequences.triplets import TripletSet
from uavdepth.camera import CameraModel

NORTH_FORWARD = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""Camera axes of a vehicle that is level and heads north: z north, x east, y down."""


def flat_depth(metres: float = 7.0) -> NDArray[np.float32]:
    return np.full((CAMERA.height, CAMERA.width), metres, np.float32)


def test_a_recording_gives_its_pictures_camera_and_poses_in_order(tmp_path: Path) -> None:
    (recording,) = open_airsim(write_airsim(tmp_path / "flight", 4))
    assert (recording.name, len(recording), recording.camera) == ("flight", 4, CAMERA)
    for index in range(4):
        np.testing.assert_array_equal(recording.image_bgr(index), picture(index))
        pose = recording.world_from_camera(index)
        np.testing.assert_allclose(pose[:3, :3], NORTH_FORWARD, atol=1e-12)
        np.testing.assert_allclose(pose[:3, 3], [index, 0.0, -2.0])
    assert recording.truth_m(0) is None


def test_a_heading_of_east_turns_the_camera_east(tmp_path: Path) -> None:
    folder = write_airsim(tmp_path)
    half = np.sqrt(0.5)
    (folder / "airsim_rec.txt").write_text(f"{HEADER}\n\t1\t0\t0\t0\t{half}\t0\t0\t{half}\timg_0.png\n")
    (recording,) = open_airsim(folder)
    np.testing.assert_allclose(recording.world_from_camera(0)[:3, 2], [0.0, 1.0, 0.0], atol=1e-12)


def test_a_folder_of_recordings_opens_all_of_them_in_order(tmp_path: Path) -> None:
    for name in ("b", "a", "c"):
        write_airsim(tmp_path / name, 3)
    assert [recording.name for recording in open_airsim(tmp_path)] == ["a", "b", "c"]


def test_depth_is_no_truth_where_it_is_nan_zero_or_negative_and_sky_where_it_is_huge(tmp_path: Path) -> None:
    depth = flat_depth()
    depth[0, :5] = [np.nan, 0.0, -1.0, 65504.0, np.inf]
    (recording,) = open_airsim(write_airsim(tmp_path, 3, depth))
    truth = recording.truth_m(1)
    assert truth is not None
    np.testing.assert_array_equal(truth[0, :6], [np.nan, np.nan, np.nan, np.inf, np.inf, 7.0])


def test_perspective_depth_of_a_wall_straight_ahead_becomes_one_z_depth(tmp_path: Path) -> None:
    folder = write_airsim(tmp_path, 1)
    rays = CAMERA.normalized_rays
    write_picture(folder / "images" / "img_Drone_0_0_123.png", 0)
    write_pfm(folder / "images" / "img_Drone_0_2_123.pfm", (7.0 * np.linalg.norm(rays, axis=-1)).astype("f4"))
    line = "Drone\t1\t0\t0\t0\t1\t0\t0\t0\timg_Drone_0_0_123.png;img_Drone_0_2_123.pfm"
    (folder / "airsim_rec.txt").write_text(f"{HEADER}\n{line}\n")
    truth = open_airsim(folder)[0].truth_m(0)
    assert truth is not None
    np.testing.assert_allclose(truth, 7.0, rtol=1e-6)


def test_segmentation_and_other_cameras_are_not_taken_for_the_picture_or_its_depth(tmp_path: Path) -> None:
    folder = write_airsim(tmp_path, 1)
    files = ("img__0_5_1.png", "img__0_0_1.png", "img__1_0_1.png", "img__1_1_1.pfm", "img__0_1_1.pfm")
    write_picture(folder / "images" / "img__0_0_1.png", 3)
    write_pfm(folder / "images" / "img__0_1_1.pfm", flat_depth(9.0))
    (folder / "airsim_rec.txt").write_text(f"{HEADER}\n\t1\t0\t0\t0\t1\t0\t0\t0\t{';'.join(files)}\n")
    (recording,) = open_airsim(folder)
    np.testing.assert_array_equal(recording.image_bgr(0), picture(3))
    truth = recording.truth_m(0)
    assert truth is not None
    assert (truth == 9.0).all()


def test_vehicles_recorded_together_are_sequences_of_their_own(tmp_path: Path) -> None:
    folder = write_airsim(tmp_path / "two", 6)
    rows = [f"{'AB'[n % 2]}\t1\t{n}\t0\t0\t1\t0\t0\t0\timg_{n}.png" for n in range(6)]
    (folder / "airsim_rec.txt").write_text("\n".join([HEADER, *rows]))
    first, second = open_airsim(folder)
    assert (first.name, second.name) == ("two/A", "two/B")
    np.testing.assert_array_equal(second.image_bgr(1), picture(3))


def test_an_interrupted_recording_loses_its_last_line_only(tmp_path: Path) -> None:
    folder = write_airsim(tmp_path, 5)
    path = folder / "airsim_rec.txt"
    path.write_text(path.read_text().rsplit("\t", 1)[0])
    triplets = TripletSet.from_sequences(open_airsim(folder))
    assert [triplet.index for triplet in triplets.triplets] == [1, 2]
    (skipped,) = triplets.skipped
    assert "line 6 has 9 fields instead of 10" in skipped.reason


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("\t1\tnorth\t0\t0\t1\t0\t0\t0\timg_1.png", "could not convert string to float: 'north'"),
        ("\t1\tnan\t0\t0\t1\t0\t0\t0\timg_1.png", "no pose"),
        ("\t1\t0\t0\t0\t0\t0\t0\t0\timg_1.png", "no pose"),
        ("\t1\t0\t0\t0\t1\t0\t0\t0\t", "names no picture"),
        ("\t1\t0\t0\t0\t1\t0\t0\t0\tlost.png", "No such file"),
    ],
)
def test_a_broken_line_is_a_gap_that_is_named(tmp_path: Path, line: str, said: str) -> None:
    folder = write_airsim(tmp_path, 7)
    path = folder / "airsim_rec.txt"
    lines = path.read_text().splitlines()
    path.write_text("\n".join([*lines[:2], line, *lines[3:]]))
    (recording,) = open_airsim(folder)
    triplets = TripletSet.from_sequences([recording])
    assert [triplet.index for triplet in triplets.triplets] == [3, 4, 5]
    assert [said in skipped.reason for skipped in triplets.skipped] == [True]
    with pytest.raises(BrokenFrameError):
        recording.image_bgr(1)


def test_intrinsics_come_from_the_folder_else_from_the_user(tmp_path: Path) -> None:
    folder = write_airsim(tmp_path)
    (folder / "camera.json").unlink()
    with pytest.raises(TrainingDataError, match="no intrinsics"):
        open_airsim(folder)
    by_angle = open_airsim(folder, Calibration(horizontal_fov_deg=90.0))[0].camera
    assert by_angle == CameraModel.from_fov(64, 48, 90.0)
    assert open_airsim(folder, Calibration(CAMERA))[0].camera == CAMERA


def test_a_calibration_of_other_pictures_is_refused_at_once(tmp_path: Path) -> None:
    folder = write_airsim(tmp_path)
    write_camera(folder / "camera.json", CAMERA.scaled(640, 480))
    with pytest.raises(TrainingDataError, match=r"64 x 48 pixels.*640 x 480"):
        open_airsim(folder)


def test_depth_of_another_size_than_its_picture_is_refused(tmp_path: Path) -> None:
    (recording,) = open_airsim(write_airsim(tmp_path, 3, np.ones((24, 32), np.float32)))
    with pytest.raises(BrokenFrameError, match=r"depth_0\.pfm is 32 x 24 pixels"):
        recording.truth_m(0)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "no column POS_X"),
        ("TimeStamp\tImageFile\n", "no column POS_X"),
        (HEADER + "\n", "no frame"),
        (HEADER + "\nbroken\n", "line 2 has 1 fields"),
    ],
)
def test_a_recording_without_frames_is_refused(tmp_path: Path, text: str, said: str) -> None:
    (write_airsim(tmp_path) / "airsim_rec.txt").write_text(text)
    with pytest.raises(TrainingDataError, match=said):
        open_airsim(tmp_path)


def test_a_folder_without_a_recording_is_named(tmp_path: Path) -> None:
    with pytest.raises(TrainingDataError, match=r"no airsim_rec\.txt in"):
        open_airsim(tmp_path)
    with pytest.raises(TrainingDataError, match=r"no folder of AirSim recordings at .*nowhere"):
        open_airsim(tmp_path / "nowhere")


def write_tartanair(folder: Path, count: int = 4, png: bool = False) -> Path:
    for number in range(count):
        write_picture(folder / "image_left" / f"{number:06d}_left.png", number)
        (folder / "depth_left").mkdir(exist_ok=True)
        depth = flat_depth(1.0 + number)
        if png:
            # OpenCV writes and reads channels in one order, so that the bytes come back as they were.
            bytes_of_floats = depth.view(np.uint8).reshape(CAMERA.height, CAMERA.width, 4)
            cv2.imwrite(str(folder / "depth_left" / f"{number:06d}_left_depth.png"), bytes_of_floats)
        else:
            np.save(folder / "depth_left" / f"{number:06d}_left_depth.npy", depth)
    half = np.sqrt(0.5)
    lines = [f"{number} 0 -2 0 0 {half} {half}" for number in range(count)]
    (folder / "pose_left.txt").write_text("\n".join(lines))
    return folder


@pytest.mark.parametrize("png", [False, True])
def test_a_tartanair_trajectory_gives_pictures_depth_and_poses(tmp_path: Path, png: bool) -> None:
    write_tartanair(tmp_path / "neighborhood" / "Easy" / "P001", png=png)
    (trajectory,) = open_tartanair(tmp_path, CAMERA)
    assert (trajectory.name, len(trajectory)) == ("neighborhood/Easy/P001", 4)
    np.testing.assert_array_equal(trajectory.image_bgr(2), picture(2))
    truth = trajectory.truth_m(2)
    assert truth is not None
    assert (truth == 3.0).all()
    pose = trajectory.world_from_camera(3)
    np.testing.assert_allclose(pose[:3, 2], [0.0, 1.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(pose[:3, 3], [3.0, 0.0, -2.0])


def test_tartanair_pictures_have_the_data_sets_own_size(tmp_path: Path) -> None:
    with pytest.raises(TrainingDataError, match=r"64 x 48 pixels.*640 x 480"):
        open_tartanair(write_tartanair(tmp_path))


def test_a_tartanair_trajectory_says_what_it_lacks(tmp_path: Path) -> None:
    with pytest.raises(TrainingDataError, match="no folder image_left"):
        open_tartanair(tmp_path)
    folder = write_tartanair(tmp_path / "P001")
    write_numbers(folder / "pose_left.txt", [0, 0, 0, 0, 0, 0, 1])
    with pytest.raises(TrainingDataError, match="1 poses for 4 pictures"):
        open_tartanair(folder, CAMERA)
    write_numbers(folder / "pose_left.txt", [0, 0, 0])
    with pytest.raises(TrainingDataError, match="line 1 has 3 numbers"):
        open_tartanair(folder, CAMERA)
    (folder / "pose_left.txt").unlink()
    with pytest.raises(BrokenFrameError, match=r"no pose_left\.txt"):
        open_tartanair(folder, CAMERA)[0].world_from_camera(0)


def test_broken_tartanair_depth_is_named(tmp_path: Path) -> None:
    folder = write_tartanair(tmp_path)
    depths = folder / "depth_left"
    (depths / "000000_left_depth.npy").write_bytes(b"\x93NUMPY")
    np.save(depths / "000001_left_depth.npy", np.ones((2, 2), np.float32))
    (depths / "000002_left_depth.npy").unlink()
    (trajectory,) = open_tartanair(folder, CAMERA)
    with pytest.raises(BrokenFrameError, match="000000_left_depth"):
        trajectory.truth_m(0)
    with pytest.raises(BrokenFrameError, match=r"shape \(2, 2\)"):
        trajectory.truth_m(1)
    assert trajectory.truth_m(2) is None
