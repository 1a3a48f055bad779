"""TartanAir trajectories: `image_left`, `depth_left` and `pose_left.txt`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from training.errors import TrainingDataError
from training.sequences.errors import BrokenFrameError
from training.sequences.picture_files import PictureFiles
from training.sequences.pictures import PICTURE_SUFFIXES, require_first_picture
from training.sequences.pose_file import read_rows
from training.sequences.quaternion import rotation_from_quaternion
from training.sequences.truth import usable_truth
from uavdepth.camera import BODY_FROM_CAMERA_AXES, CameraModel

TARTANAIR_CAMERA = CameraModel(640, 480, 320.0, 320.0, 320.0, 240.0)
"""The same for the whole data set (Wang et al. 2020)."""

_IMAGES, _DEPTHS, _POSES = "image_left", "depth_left", "pose_left.txt"


@dataclass(frozen=True)
class TartanAirTrajectory(PictureFiles):
    """One trajectory; a `FrameSequence` with poses.

    Args:
        name: of the trajectory below the opened folder.
        camera: of the pictures.
        pictures: in the order of their names.
        depths: beside them, or None.
        poses: (N, 7) x, y, z (NED, metres) and quaternion x, y, z, w of the camera, or None.
    """

    depths: tuple[Path | None, ...]
    poses: NDArray[np.float64] | None

    def truth_m(self, index: int) -> NDArray[np.float32] | None:
        """(H, W) z-depth. Raises BrokenFrameError: unreadable or of another size."""
        path = self.depths[index]
        if path is None:
            return None
        depth = _read_npy(path) if path.suffix == ".npy" else _read_float_png(path)
        if depth.shape != (self.camera.height, self.camera.width):
            raise BrokenFrameError(
                f"{path} is of shape {depth.shape}, its camera has {self.camera.height} x {self.camera.width}"
            )
        return usable_truth(depth)

    def world_from_camera(self, index: int) -> NDArray[np.float64]:
        """(4, 4) pose in north, east, down. Raises BrokenFrameError: no poses were recorded."""
        if self.poses is None:
            raise BrokenFrameError(f"{self.name} has no {_POSES}")
        x, y, z, qx, qy, qz, qw = self.poses[index]
        pose = np.eye(4)
        pose[:3, :3] = rotation_from_quaternion(qw, qx, qy, qz) @ BODY_FROM_CAMERA_AXES
        pose[:3, 3] = x, y, z
        return pose


def open_tartanair(root: Path, camera: CameraModel = TARTANAIR_CAMERA) -> list[TartanAirTrajectory]:
    """The trajectory in a folder, or all trajectories anywhere below it, sorted.

    Args:
        root: a folder with `image_left`, or one above such folders (ENVIRONMENT/Easy/P001).
        camera: intrinsics, if they are not the data set's.

    Raises:
        TrainingDataError: no trajectory there, pictures of another size, or poses that do not fit.
    """
    if not root.is_dir():
        raise TrainingDataError(f"no folder of TartanAir data at {root}")
    folders = sorted(path.parent for path in root.rglob(_IMAGES) if path.is_dir())
    if not folders:
        raise TrainingDataError(f"no folder {_IMAGES} in {root} or below it")
    return [_open_trajectory(root, folder, camera) for folder in folders]


def _open_trajectory(root: Path, folder: Path, camera: CameraModel) -> TartanAirTrajectory:
    pictures = sorted(p for p in (folder / _IMAGES).iterdir() if p.suffix.lower() in PICTURE_SUFFIXES)
    if not pictures:
        raise TrainingDataError(f"no pictures in {folder / _IMAGES}")
    require_first_picture(pictures[0], camera)
    poses = read_rows(folder / _POSES, 7) if (folder / _POSES).is_file() else None
    if poses is not None and len(poses) != len(pictures):
        raise TrainingDataError(f"{folder / _POSES} has {len(poses)} poses for {len(pictures)} pictures")
    name = folder.name if folder == root else folder.relative_to(root).as_posix()
    depths = tuple(_depth_of(folder / _DEPTHS, picture.stem) for picture in pictures)
    return TartanAirTrajectory(name, camera, tuple(pictures), depths, poses)


def _depth_of(folder: Path, stem: str) -> Path | None:
    """NNNNNN_left has NNNNNN_left_depth.npy, in the data set's second edition .png."""
    candidates = (folder / f"{stem}_depth{suffix}" for suffix in (".npy", ".png"))
    return next((path for path in candidates if path.is_file()), None)


def _read_npy(path: Path) -> NDArray[np.float32]:
    try:
        return np.asarray(np.load(path, allow_pickle=False), np.float32)
    except (OSError, ValueError, EOFError) as error:
        raise BrokenFrameError(f"cannot read the depth map {path}: {error}") from error


def _read_float_png(path: Path) -> NDArray[np.float32]:
    """Float32 numbers whose four bytes are a PNG's four channels."""
    try:
        content = np.fromfile(path, np.uint8)
        picture = cv2.imdecode(content, cv2.IMREAD_UNCHANGED) if content.size else None
    except (OSError, cv2.error) as error:
        raise BrokenFrameError(f"cannot read the depth map {path}: {error}") from error
    if picture is None or picture.dtype != np.uint8 or picture.ndim != 3 or picture.shape[2] != 4:
        raise BrokenFrameError(f"{path} is not a PNG of four 8-bit channels that hold a float each")
    return np.ascontiguousarray(picture).view("<f4")[:, :, 0].astype(np.float32)
