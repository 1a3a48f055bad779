"""KITTI raw data: drives of rectified colour pictures with LiDAR and navigation."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from training.errors import TrainingDataError
from training.sequences.frame_sequence import file_problem
from training.sequences.kitti_calibration import camera_from_projection, matrix, projection, read_matrices
from training.sequences.numbered_files import numbered_files, without_gaps
from training.sequences.oxts import Oxts, read_oxts
from training.sequences.pictures import read_calibrated_picture, require_first_picture
from training.sequences.truth import usable_truth
from training.sequences.velodyne import project_points, read_velodyne
from uavdepth.camera import CameraModel

SIDES = {"l": "02", "r": "03"}
"""Split files call the colour cameras l and r."""

_SUFFIXES = (".png", ".jpg")


@dataclass(frozen=True)
class KittiDrive:
    """The pictures of one colour camera on one drive; a `FrameSequence` with LiDAR and navigation.

    Args:
        name: date/drive/image_NN.
        camera: of the rectified pictures.
        pictures: of consecutive frame numbers; one that is missing on the disk is in its place all the same.
        first_number: frame number of the first picture.
        image_from_lidar: (3, 4) projection of LiDAR points onto the picture, or None without calibration.
    """

    name: str
    camera: CameraModel
    pictures: tuple[Path, ...]
    first_number: int
    image_from_lidar: NDArray[np.float64] | None

    def __len__(self) -> int:
        return len(self.pictures)

    def index_of(self, number: int) -> int | None:
        """Index of a frame number as split files give it, or None."""
        index = number - self.first_number
        return index if 0 <= index < len(self) else None

    def file_of(self, index: int) -> Path:
        """The picture."""
        return self.pictures[index]

    def problem(self, index: int) -> str | None:
        """A missing or empty picture."""
        return file_problem(self.pictures[index])

    def image_bgr(self, index: int) -> NDArray[np.uint8]:
        """(H, W, 3) picture. Raises BrokenFrameError: missing, unreadable or of another size."""
        return read_calibrated_picture(self.pictures[index], self.camera)

    def truth_m(self, index: int) -> NDArray[np.float32] | None:
        """(H, W) z-depth of the LiDAR's points, NaN between them. Raises BrokenFrameError: unreadable."""
        path = self._beside("velodyne_points", index, ".bin")
        if self.image_from_lidar is None or not path.is_file():
            return None
        return usable_truth(project_points(read_velodyne(path), self.image_from_lidar, self.camera))

    def oxts(self, index: int) -> Oxts | None:
        """The vehicle's motion, or None where it was not recorded. Raises BrokenFrameError: unreadable."""
        path = self._beside("oxts", index, ".txt")
        return read_oxts(path) if path.is_file() else None

    def _beside(self, kind: str, index: int, suffix: str) -> Path:
        picture = self.pictures[index]
        return picture.parents[2] / kind / "data" / (picture.stem + suffix)


def open_kitti_raw(root: Path) -> list[KittiDrive]:
    """Every drive and colour camera below a folder of dates, sorted.

    Args:
        root: the raw set's own layout: DATE/calib_cam_to_cam.txt, DATE/DRIVE/image_02/data/0000000000.png.

    Raises:
        TrainingDataError: no drive there, a calibration that is missing or broken, or pictures of another
            size than it says.
    """
    if not root.is_dir():
        raise TrainingDataError(f"no folder of KITTI raw data at {root}")
    folders = sorted(root.glob("*/*/image_0[23]"))
    drives = [drive for folder in folders if (drive := _open_drive(root, folder)) is not None]
    if not drives:
        raise TrainingDataError(f"no DATE/DRIVE/image_02/data/*.png or image_03 in {root}")
    return drives


def _open_drive(root: Path, folder: Path) -> KittiDrive | None:
    data = folder / "data"
    files = numbered_files(data, _SUFFIXES) if data.is_dir() else {}
    if not files:
        return None
    number = folder.name[-2:]
    date = folder.parent.parent
    calibration = date / "calib_cam_to_cam.txt"
    matrices = read_matrices(calibration)
    image_from_rectified = projection(calibration, matrices, f"P_rect_{number}")
    width, height = (int(each) for each in matrix(calibration, matrices, f"S_rect_{number}", 1, 2)[0])
    camera = camera_from_projection(calibration, image_from_rectified, width, height)
    pictures = without_gaps(files)
    require_first_picture(pictures[0], camera)
    return KittiDrive(
        folder.relative_to(root).as_posix(),
        camera,
        pictures,
        min(files),
        _image_from_lidar(date, image_from_rectified, matrix(calibration, matrices, "R_rect_00", 3, 3)),
    )


def _image_from_lidar(
    date: Path, image_from_rectified: NDArray[np.float64], rectification: NDArray[np.float64]
) -> NDArray[np.float64] | None:
    """(3, 4) P_rect R_rect_00 T_velo_to_cam (Geiger et al. 2013, eq. 8)."""
    path = date / "calib_velo_to_cam.txt"
    if not path.is_file():
        return None
    matrices = read_matrices(path)
    camera_from_lidar, rectified_from_camera = np.eye(4), np.eye(4)
    camera_from_lidar[:3, :3] = matrix(path, matrices, "R", 3, 3)
    camera_from_lidar[:3, 3] = matrix(path, matrices, "T", 1, 3)[0]
    rectified_from_camera[:3, :3] = rectification
    return np.asarray(image_from_rectified @ rectified_from_camera @ camera_from_lidar)
