"""KITTI in its own layouts: calibration, LiDAR, split files, navigation and poses."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from sequence_files import (
    DRIVE,
    KITTI_CAMERA,
    picture,
    write_kitti_raw,
    write_numbers,
    write_picture,
)

from training.errors import TrainingDataError
from training.sequences.errors import BrokenFrameError
from training.sequences.garg_crop import garg_mask
from training.sequences.kitti_odometry import open_kitti_odometry
from training.sequences.kitti_raw import open_kitti_raw
from training.sequences.opening import open_triplets
from training.sequences.oxts import Oxts
from training.sequences.split_file import read_split, split_frames, split_triplets
from training.sequences.velodyne import project_points


def test_a_drive_gives_both_colour_cameras_with_pixels_counted_from_zero(tmp_path: Path) -> None:
    left, right = open_kitti_raw(write_kitti_raw(tmp_path))
    assert (left.name, right.name) == (f"{DRIVE}/image_02", f"{DRIVE}/image_03")
    assert left.camera == KITTI_CAMERA
    np.testing.assert_array_equal(left.image_bgr(4), picture(4, KITTI_CAMERA))
    assert left.truth_m(0) is None


def test_lidar_points_land_on_their_pixels_and_the_nearest_of_a_pixel_counts(tmp_path: Path) -> None:
    # LiDAR: x forward, y left, z up. 10 m ahead, 40 px focal length: 4 px right is 1 m right.
    points = np.array(
        [
            [10.0, 0.0, 0.0],
            [10.0, -1.0, 0.0],
            [20.0, -2.0, 0.0],
            [10.0, 0.0, -1.0],
            [-10.0, 0.0, 0.0],
            [10.0, 50.0, 0.0],
            [np.nan, 0.0, 0.0],
        ],
        np.float32,
    )
    left, _ = open_kitti_raw(write_kitti_raw(tmp_path, points=points))
    truth = left.truth_m(0)
    assert truth is not None
    assert truth.shape == (24, 64)
    known = {(int(row), int(column)): float(truth[row, column]) for row, column in np.argwhere(truth > 0)}
    assert known == {(12, 30): 10.0, (12, 34): 10.0, (16, 30): 10.0}
    assert np.isnan(truth).sum() == truth.size - 3


def test_the_right_camera_sees_points_further_left(tmp_path: Path) -> None:
    points = np.array([[10.0, 0.0, 0.0]], np.float32)
    _, right = open_kitti_raw(write_kitti_raw(tmp_path, points=points))
    truth = right.truth_m(0)
    assert truth is not None
    assert np.argwhere(truth > 0).tolist() == [[12, 28]]


def test_a_cloud_without_points_in_view_is_a_picture_without_truth() -> None:
    behind = np.array([[-1.0, 0.0, 0.0]], np.float32)
    assert np.isnan(project_points(behind, np.eye(3, 4), KITTI_CAMERA)).all()


def test_broken_lidar_and_navigation_are_named(tmp_path: Path) -> None:
    left, _ = open_kitti_raw(write_kitti_raw(tmp_path, points=np.ones((2, 3), np.float32)))
    (tmp_path / DRIVE / "velodyne_points/data/0000000001.bin").write_bytes(bytes(17))
    (tmp_path / DRIVE / "oxts/data/0000000001.txt").write_text("1 2 3")
    with pytest.raises(BrokenFrameError, match=r"0000000001\.bin has 17 bytes"):
        left.truth_m(1)
    with pytest.raises(BrokenFrameError, match=r"0000000001\.txt has 3 numbers"):
        left.oxts(1)


def test_navigation_gives_attitude_and_velocity_along_the_vehicle(tmp_path: Path) -> None:
    left, _ = open_kitti_raw(write_kitti_raw(tmp_path))
    assert left.oxts(2) == Oxts(3.0, 4.0, 5.0, 8.0, 9.0, 10.0)
    (tmp_path / DRIVE / "oxts/data/0000000002.txt").unlink()
    assert left.oxts(2) is None


def test_garg_crop_of_a_full_size_picture() -> None:
    rows, columns = np.nonzero(garg_mask(375, 1242))
    assert (rows.min(), rows.max(), columns.min(), columns.max()) == (153, 370, 44, 1196)


@pytest.mark.parametrize(
    ("file", "text", "said"),
    [
        ("calib_cam_to_cam.txt", None, "cannot read the calibration"),
        ("calib_cam_to_cam.txt", "S_rect_02: 64 24\n", "has no P_rect_02"),
        ("calib_cam_to_cam.txt", "P_rect_02: 1 2 3\n", "P_rect_02 has 3 numbers"),
        ("calib_velo_to_cam.txt", "R: 1 0 0 0 1 0 0 0 nan\nT: 0 0 0\n", "R has 9 numbers"),
    ],
)
def test_a_broken_calibration_is_named(tmp_path: Path, file: str, text: str | None, said: str) -> None:
    path = write_kitti_raw(tmp_path) / "2011_09_26" / file
    path.unlink()
    if text is not None:
        path.write_text(text)
    with pytest.raises(TrainingDataError, match=said) as raised:
        open_kitti_raw(tmp_path)
    assert file in str(raised.value)


def test_without_the_lidars_calibration_there_is_no_truth_but_there_are_pictures(tmp_path: Path) -> None:
    root = write_kitti_raw(tmp_path, points=np.ones((2, 3), np.float32))
    (root / "2011_09_26/calib_velo_to_cam.txt").unlink()
    assert open_kitti_raw(root)[0].truth_m(0) is None


def test_pictures_of_another_size_than_the_calibration_are_refused(tmp_path: Path) -> None:
    path = write_kitti_raw(tmp_path) / "2011_09_26/calib_cam_to_cam.txt"
    path.write_text(path.read_text().replace("6.4e+01 2.4e+01", "1242 375"))
    with pytest.raises(TrainingDataError, match=r"64 x 24 pixels.*1242 x 375"):
        open_kitti_raw(tmp_path)


def test_a_split_chooses_frames_by_drive_number_and_side(tmp_path: Path) -> None:
    drives = open_kitti_raw(write_kitti_raw(tmp_path / "raw", range(10, 16)))
    split = tmp_path / "split.txt"
    split.write_text(f"{DRIVE} 0000000012 l\n{DRIVE} 13 r\n\n{DRIVE} 14\n")
    triplets = split_triplets(drives, read_split(split)).triplets
    assert [(t.sequence.name[-2:], t.sequence.file_of(t.index).stem) for t in triplets] == [
        ("02", "0000000012"),
        ("03", "0000000013"),
        ("02", "0000000014"),
    ]


def test_frames_of_a_split_that_are_not_there_are_named_and_counted(tmp_path: Path) -> None:
    root = write_kitti_raw(tmp_path / "raw", range(5))
    (root / DRIVE / "image_02/data/0000000003.png").unlink()
    lines = [f"{DRIVE} 1 l", f"{DRIVE} 2 l", f"{DRIVE} 3 l", f"{DRIVE} 0 l", f"{DRIVE} 99 l", "x/y 1 l"]
    split = tmp_path / "split.txt"
    split.write_text("\n".join(lines))
    drives = open_kitti_raw(root)
    single = split_frames(drives, read_split(split))
    assert [index for _, index in single.frames] == [1, 2, 0]
    assert [skipped.reason for skipped in single.skipped] == [
        "No such file or directory",
        "no such frame",
        "no such drive",
    ]
    three = open_triplets("kitti-raw", root, split=split)
    assert [triplet.index for triplet in three.triplets] == [1]
    assert len(three.skipped) == 5


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (None, "cannot read the split file"),
        ("\n", "is empty"),
        (f"{DRIVE}\n", "line 1"),
        (f"{DRIVE} 1 l\n{DRIVE} one l\n", "line 2"),
        (f"{DRIVE} 1 m\n", "line 1"),
    ],
)
def test_a_broken_split_file_is_named(tmp_path: Path, text: str | None, said: str) -> None:
    path = tmp_path / "eigen.txt"
    if text is not None:
        path.write_text(text)
    with pytest.raises(TrainingDataError, match=said) as raised:
        read_split(path)
    assert "eigen.txt" in str(raised.value)


def test_a_split_of_other_drives_is_refused(tmp_path: Path) -> None:
    root = write_kitti_raw(tmp_path / "raw")
    split = tmp_path / "split.txt"
    split.write_text("2011_10_03/2011_10_03_drive_0047_sync 1 l\n")
    with pytest.raises(TrainingDataError, match="not one of the split's 1 frames"):
        open_triplets("kitti-raw", root, split=split)
    with pytest.raises(TrainingDataError, match="split files are for kitti-raw"):
        open_triplets("airsim", root, split=split)


def test_no_drive_and_no_folder_are_named(tmp_path: Path) -> None:
    with pytest.raises(TrainingDataError, match="no DATE/DRIVE/image_02"):
        open_kitti_raw(tmp_path)
    with pytest.raises(TrainingDataError, match="no folder of KITTI raw data"):
        open_kitti_raw(tmp_path / "nowhere")


def write_odometry(folder: Path, camera: str = "image_0", named: bool = True) -> Path:
    """Four frames that drive forward at 1.1 m a frame; camera 2 sits 0.5 m to the right of camera 0."""
    for number in range(4):
        write_picture(folder / camera / f"{number:06d}.png", number, KITTI_CAMERA)
    shifts = (0.0, -20.0, -20.0, 0.0)
    rows = [f"40 0 31 {shift} 0 40 13 0 0 0 1 0" for shift in shifts]
    names = [f"P{n}: " if named else "" for n in range(4)]
    (folder / "calib.txt").write_text("\n".join(name + row for name, row in zip(names, rows, strict=True)))
    poses = [f"1 0 0 0 0 1 0 0 0 0 1 {1.1 * number}" for number in range(4)]
    (folder / "poses.txt").write_text("\n".join(poses))
    return folder


@pytest.mark.parametrize("named", [True, False])
def test_an_odometry_sequence_gives_camera_and_poses(tmp_path: Path, named: bool) -> None:
    write_odometry(tmp_path / "01", named=named)
    (sequence,) = open_kitti_odometry(tmp_path)
    assert (sequence.name, len(sequence), sequence.camera) == ("01/image_0", 4, KITTI_CAMERA)
    np.testing.assert_array_equal(sequence.image_bgr(3), picture(3, KITTI_CAMERA))
    np.testing.assert_allclose(sequence.world_from_camera(2)[:3, 3], [0.0, 0.0, 2.2])
    assert sequence.truth_m(0) is None


def test_poses_of_another_camera_count_its_place_beside_the_first(tmp_path: Path) -> None:
    (sequence,) = open_kitti_odometry(write_odometry(tmp_path, "image_2"))
    np.testing.assert_allclose(sequence.world_from_camera(1)[:3, 3], [0.5, 0.0, 1.1])


def test_the_published_layout_keeps_poses_apart_from_the_sequences(tmp_path: Path) -> None:
    folder = write_odometry(tmp_path / "sequences" / "07")
    (tmp_path / "poses").mkdir()
    (folder / "poses.txt").rename(tmp_path / "poses" / "07.txt")
    (sequence,) = open_kitti_odometry(tmp_path)
    np.testing.assert_allclose(sequence.world_from_camera(1)[:3, 3], [0.0, 0.0, 1.1])
    (tmp_path / "poses" / "07.txt").unlink()
    with pytest.raises(BrokenFrameError, match="no pose of frame 1"):
        open_kitti_odometry(tmp_path)[0].world_from_camera(1)


def test_odometry_lidar_is_projected_with_its_tr(tmp_path: Path) -> None:
    folder = write_odometry(tmp_path)
    with (folder / "calib.txt").open("a") as calibration:
        calibration.write("\nTr: 0 -1 0 0 0 0 -1 0 1 0 0 0\n")
    (folder / "velodyne").mkdir()
    np.array([[10.0, -1.0, 0.0, 0.0]], "<f4").tofile(folder / "velodyne" / "000000.bin")
    truth = open_kitti_odometry(folder)[0].truth_m(0)
    assert truth is not None
    assert np.argwhere(truth > 0).tolist() == [[12, 34]]


def test_broken_odometry_data_is_named(tmp_path: Path) -> None:
    with pytest.raises(TrainingDataError, match=r"no calib\.txt"):
        open_kitti_odometry(tmp_path)
    folder = write_odometry(tmp_path)
    write_numbers(folder / "poses.txt", [1, 2, 3])
    with pytest.raises(TrainingDataError, match=r"poses\.txt, line 1 has 3 numbers"):
        open_kitti_odometry(folder)
    (folder / "poses.txt").unlink()
    for path in (folder / "image_0").iterdir():
        path.write_bytes(b"not a picture")
    with pytest.raises(TrainingDataError, match="not one of 4 pictures can be read"):
        open_kitti_odometry(folder)
