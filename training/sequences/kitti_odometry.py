"""KITTI odometry: sequences of rectified pictures with `calib.txt` and, for some, the camera's poses."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from training.errors import TrainingDataError
from training.sequences.errors import BrokenFrameError
from training.sequences.kitti_calibration import camera_from_projection, matrix, projection, read_matrices
from training.sequences.numbered_files import numbered_files, without_gaps
from training.sequences.picture_files import PictureFiles
from training.sequences.pictures import read_picture
from training.sequences.pose_file import read_rows
from training.sequences.truth import usable_truth
from training.sequences.velodyne import project_points, read_velodyne

_CAMERAS = ("image_2", "image_3", "image_0", "image_1")
"""Colour before grey, left before right."""

_SUFFIXES = (".png", ".jpg")


@dataclass(frozen=True)
class KittiOdometrySequence(PictureFiles):
    """The pictures of one camera of one sequence; a `FrameSequence`, with poses where they are published.

    Args:
        name: sequence/image_N.
        camera: of the rectified pictures.
        pictures: of consecutive frame numbers; one that is missing on the disk is in its place all the same.
        first_number: frame number of the first picture.
        image_from_lidar: (3, 4) projection of LiDAR points, or None.
        poses: (N, 3, 4) world from the left grey camera, or None.
        left_from_camera: (4, 4) pose of this camera in the left grey one's axes.
    """

    first_number: int
    image_from_lidar: NDArray[np.float64] | None
    poses: NDArray[np.float64] | None
    left_from_camera: NDArray[np.float64]

    def truth_m(self, index: int) -> NDArray[np.float32] | None:
        """(H, W) z-depth of the LiDAR's points, NaN between them. Raises BrokenFrameError: unreadable."""
        picture = self.pictures[index]
        path = picture.parents[1] / "velodyne" / f"{picture.stem}.bin"
        if self.image_from_lidar is None or not path.is_file():
            return None
        return usable_truth(project_points(read_velodyne(path), self.image_from_lidar, self.camera))

    def world_from_camera(self, index: int) -> NDArray[np.float64]:
        """(4, 4) pose in the axes of the left grey camera at frame 0.

        Raises:
            BrokenFrameError: no pose is published for this frame.
        """
        number = self.first_number + index
        if self.poses is None or number >= len(self.poses):
            raise BrokenFrameError(f"{self.name}: no pose of frame {number}")
        pose = np.eye(4)
        pose[:3] = self.poses[number]
        return np.asarray(pose @ self.left_from_camera)


def open_kitti_odometry(root: Path) -> list[KittiOdometrySequence]:
    """The sequence in a folder, or all in its sub-folders, sorted; of each the first camera there is.

    Args:
        root: a folder with `calib.txt` and `image_2`, `image_3`, `image_0` or `image_1`, or one whose
            sub-folders (or their parent `sequences`) have them. Poses are `poses.txt` beside the pictures
            or `poses/NN.txt` beside `sequences`.

    Raises:
        TrainingDataError: no sequence there, or a calibration or poses that are broken.
    """
    if not root.is_dir():
        raise TrainingDataError(f"no folder of KITTI odometry data at {root}")
    if (root / "calib.txt").is_file():
        folders = [root]
    else:
        folders = sorted(
            p.parent for pattern in ("*", "sequences/*") for p in root.glob(f"{pattern}/calib.txt")
        )
    sequences = [sequence for folder in folders if (sequence := _open_sequence(folder)) is not None]
    if not sequences:
        raise TrainingDataError(f"no calib.txt with {' or '.join(_CAMERAS)} beside it in {root}")
    return sequences


def _open_sequence(folder: Path) -> KittiOdometrySequence | None:
    present = [name for name in _CAMERAS if (folder / name).is_dir()]
    files = numbered_files(folder / present[0], _SUFFIXES) if present else {}
    if not files:
        return None
    pictures = without_gaps(files)
    calibration = folder / "calib.txt"
    matrices = read_matrices(calibration)
    image_from_left = projection(calibration, matrices, f"P{present[0][-1]}")
    # calib.txt says no size: the pictures themselves do.
    height, width = _first_size(pictures)
    lidar = None
    if "Tr" in matrices:
        camera_from_lidar = np.eye(4)
        camera_from_lidar[:3] = matrix(calibration, matrices, "Tr", 3, 4)
        lidar = np.asarray(image_from_left @ camera_from_lidar)
    left_from_camera = np.eye(4)
    left_from_camera[:3, 3] = -np.linalg.solve(image_from_left[:, :3], image_from_left[:, 3])
    return KittiOdometrySequence(
        f"{folder.name}/{present[0]}",
        camera_from_projection(calibration, image_from_left, width, height),
        pictures,
        min(files),
        lidar,
        _read_poses(folder),
        left_from_camera,
    )


def _first_size(pictures: tuple[Path, ...]) -> tuple[int, int]:
    problem: BrokenFrameError | None = None
    for path in pictures:
        try:
            height, width = read_picture(path).shape[:2]
        except BrokenFrameError as error:
            problem = problem or error
        else:
            return height, width
    raise TrainingDataError(f"not one of {len(pictures)} pictures can be read: {problem}")


def _read_poses(folder: Path) -> NDArray[np.float64] | None:
    for path in (folder / "poses.txt", folder.parent.parent / "poses" / f"{folder.name}.txt"):
        if path.is_file():
            return read_rows(path, 12).reshape(-1, 3, 4)
    return None
