"""Tiny recordings in the layouts of the readers, written to a folder."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from training.sequences.errors import BrokenFrameError
from training.sequences.frame_sequence import FrameSequence
from training.sequences.pfm import write_pfm
from uavdepth.camera import CameraModel

CAMERA = CameraModel(64, 48, 32.0, 36.0, 31.0, 24.0)
HEADER = "VehicleName\tTimeStamp\tPOS_X\tPOS_Y\tPOS_Z\tQ_W\tQ_X\tQ_Y\tQ_Z\tImageFile"


def picture(number: int, camera: CameraModel = CAMERA) -> NDArray[np.uint8]:
    """Smooth coloured noise that moves by two pixels a frame; every number gives another picture."""
    rng = np.random.default_rng(7)
    scene = rng.integers(0, 256, (camera.height // 4, camera.width // 2, 3)).astype(np.uint8)
    wide = cv2.resize(scene, (camera.width * 2, camera.height), interpolation=cv2.INTER_CUBIC)
    return np.ascontiguousarray(np.roll(wide, -2 * number, axis=1)[:, : camera.width], np.uint8)


def write_picture(path: Path, number: int, camera: CameraModel = CAMERA) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    assert cv2.imwrite(str(path), picture(number, camera))
    return path


def write_airsim(folder: Path, count: int = 6, depth: NDArray[np.float32] | None = None) -> Path:
    """A recording that flies north at 1 m a frame, 2 m above its start, with `camera.json`."""
    lines = [HEADER]
    for number in range(count):
        write_picture(folder / "images" / f"img_{number}.png", number)
        files = f"img_{number}.png"
        if depth is not None:
            write_pfm(folder / "images" / f"depth_{number}.pfm", depth)
            files += f";depth_{number}.pfm"
        lines.append(f"\t{1000 + number}\t{number}.0\t0.0\t-2.0\t1.0\t0.0\t0.0\t0.0\t{files}")
    (folder / "airsim_rec.txt").write_text("\n".join(lines) + "\n")
    write_camera(folder / "camera.json")
    return folder


def write_camera(path: Path, camera: CameraModel = CAMERA) -> Path:
    keys = ("width", "height", "fx", "fy", "cx", "cy")
    path.write_text(json.dumps({key: getattr(camera, key) for key in keys}))
    return path


KITTI_CAMERA = CameraModel(64, 24, 40.0, 40.0, 30.0, 12.0)
"""What the written calibration says, with pixels counted from 0 (the file counts from 1)."""

CAM_TO_CAM = """calib_time: 09-Jan-2012 13:57:47
S_rect_02: 6.4e+01 2.4e+01
R_rect_00: 1 0 0 0 1 0 0 0 1
P_rect_02: 40 0 31 0 0 40 13 0 0 0 1 0
S_rect_03: 6.4e+01 2.4e+01
P_rect_03: 40 0 31 -20 0 40 13 0 0 0 1 0
"""
VELO_TO_CAM = """calib_time: 15-Mar-2012 11:37:16
R: 0 -1 0 0 0 -1 1 0 0
T: 0 0 0
"""
DRIVE = "2011_09_26/2011_09_26_drive_0002_sync"


def write_kitti_raw(
    root: Path, numbers: Sequence[int] = range(5), points: NDArray[np.float32] | None = None
) -> Path:
    """One drive with both colour cameras; LiDAR looks along the cameras' axis from the same place."""
    date = root / "2011_09_26"
    date.mkdir(parents=True)
    (date / "calib_cam_to_cam.txt").write_text(CAM_TO_CAM)
    (date / "calib_velo_to_cam.txt").write_text(VELO_TO_CAM)
    for number in numbers:
        for camera in ("image_02", "image_03"):
            write_picture(root / DRIVE / camera / "data" / f"{number:010d}.png", number, KITTI_CAMERA)
        write_numbers(root / DRIVE / "oxts" / "data" / f"{number:010d}.txt", range(30))
        if points is not None:
            path = root / DRIVE / "velodyne_points" / "data" / f"{number:010d}.bin"
            path.parent.mkdir(parents=True, exist_ok=True)
            np.hstack([points, np.zeros((len(points), 1))]).astype("<f4").tofile(path)
    return root


def write_numbers(path: Path, numbers: Sequence[float]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(" ".join(str(number) for number in numbers) + "\n")


@dataclass(frozen=True)
class CountedSequence:
    """A sequence that writes down which frames were decoded; `broken` ones cannot be."""

    inner: FrameSequence
    decoded: list[int]
    broken: frozenset[int] = frozenset()

    @property
    def name(self) -> str:
        return self.inner.name

    @property
    def camera(self) -> CameraModel:
        return self.inner.camera

    def __len__(self) -> int:
        return len(self.inner)

    def file_of(self, index: int) -> Path:
        return self.inner.file_of(index)

    def problem(self, index: int) -> str | None:
        return self.inner.problem(index)

    def image_bgr(self, index: int) -> NDArray[np.uint8]:
        self.decoded.append(index)
        if index in self.broken:
            raise BrokenFrameError(f"frame {index} is broken")
        return self.inner.image_bgr(index)

    def truth_m(self, index: int) -> NDArray[np.float32] | None:
        return self.inner.truth_m(index)
