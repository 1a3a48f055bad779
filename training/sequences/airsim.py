"""Recordings of AirSim: `airsim_rec.txt` and a folder `images`; rendered flights have the same layout."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from training.errors import TrainingDataError
from training.sequences.calibration import NO_CALIBRATION, Calibration
from training.sequences.camera_file import read_camera
from training.sequences.errors import BrokenFrameError
from training.sequences.frame_sequence import file_problem
from training.sequences.pfm import read_pfm
from training.sequences.pictures import (
    PICTURE_SUFFIXES,
    read_calibrated_picture,
    require_size,
)
from training.sequences.quaternion import rotation_from_quaternion
from training.sequences.truth import planar_depth, usable_truth
from uavdepth.camera import BODY_FROM_CAMERA_AXES, CameraModel

RECORDING = "airsim_rec.txt"
CAMERA = "camera.json"
IMAGES = "images"

_POSE = ("POS_X", "POS_Y", "POS_Z", "Q_W", "Q_X", "Q_Y", "Q_Z")
_PICTURES = "ImageFile"
_VEHICLE = "VehicleName"
_NAMED_BY_AIRSIM = re.compile(r"(?P<camera>img_.*)_(?P<type>\d+)_\d+$")
_SCENE, _DEPTH_PLANAR, _DEPTH_PERSPECTIVE = 0, 1, 2
"""AirSim's `ImageType`, the last number but one of a file's name."""


@dataclass(frozen=True)
class RecordedFrame:
    """One line of the recording.

    Args:
        picture: the camera's picture.
        depth: PFM file, or None.
        perspective: whether the depth is the distance from the camera's centre, not along its axis.
        pose: x, y, z (NED, metres) and the quaternion w, x, y, z of the vehicle; None: a broken line.
        trouble: why the line cannot be used, or None.
        vehicle: whose camera it was; None: a broken line.
    """

    picture: Path
    depth: Path | None = None
    perspective: bool = False
    pose: tuple[float, ...] | None = None
    trouble: str | None = None
    vehicle: str | None = None


@dataclass(frozen=True)
class AirSimRecording:
    """One recording; a `FrameSequence` with poses."""

    name: str
    camera: CameraModel
    frames: tuple[RecordedFrame, ...]

    def __len__(self) -> int:
        return len(self.frames)

    def file_of(self, index: int) -> Path:
        """The picture."""
        return self.frames[index].picture

    def problem(self, index: int) -> str | None:
        """A broken line, or a missing or empty picture."""
        frame = self.frames[index]
        return frame.trouble or file_problem(frame.picture)

    def image_bgr(self, index: int) -> NDArray[np.uint8]:
        """(H, W, 3) picture. Raises BrokenFrameError: missing, unreadable or of another size."""
        frame = self.frames[index]
        if frame.trouble is not None:
            raise BrokenFrameError(f"{frame.picture}: {frame.trouble}")
        return read_calibrated_picture(frame.picture, self.camera)

    def truth_m(self, index: int) -> NDArray[np.float32] | None:
        """(H, W) z-depth. Raises BrokenFrameError: unreadable or of another size."""
        frame = self.frames[index]
        if frame.depth is None:
            return None
        depth = read_pfm(frame.depth)
        require_size(frame.depth, depth.shape, self.camera)
        return usable_truth(planar_depth(depth, self.camera) if frame.perspective else depth)

    def world_from_camera(self, index: int) -> NDArray[np.float64]:
        """(4, 4) pose in north, east, down of a camera that looks straight ahead from the vehicle's origin.

        Raises:
            BrokenFrameError: the line of the recording is broken.
        """
        pose = self.frames[index].pose
        if pose is None:
            raise BrokenFrameError(f"{self.name}: frame {index} has no pose")
        matrix = np.eye(4)
        matrix[:3, :3] = rotation_from_quaternion(*pose[3:]) @ BODY_FROM_CAMERA_AXES
        matrix[:3, 3] = pose[:3]
        return matrix


def open_airsim(root: Path, calibration: Calibration = NO_CALIBRATION) -> list[AirSimRecording]:
    """The recording in a folder, or all recordings in its sub-folders, sorted; one for each vehicle.

    Args:
        root: a folder with `airsim_rec.txt`, or one whose sub-folders have it.
        calibration: of recordings without a `camera.json`.

    Raises:
        TrainingDataError: no recording there, no intrinsics, no header, or pictures of another size.
    """
    if not root.is_dir():
        raise TrainingDataError(f"no folder of AirSim recordings at {root}")
    folders = (
        [root] if (root / RECORDING).is_file() else sorted(p.parent for p in root.glob(f"*/{RECORDING}"))
    )
    if not folders:
        raise TrainingDataError(f"no {RECORDING} in {root} or in its sub-folders")
    return [recording for folder in folders for recording in _open_recordings(folder, calibration)]


def _open_recordings(folder: Path, calibration: Calibration) -> list[AirSimRecording]:
    frames = _read_recording(folder)
    readable = (each.picture for each in frames if each.trouble is None)
    first = next((path for path in readable if file_problem(path) is None), None)
    if first is None:
        what = frames[0].trouble or "none of its pictures is there" if frames else "no frame"
        raise TrainingDataError(f"{folder / RECORDING} holds nothing usable: {what}")
    described = folder / CAMERA
    if described.is_file():
        calibration = Calibration(read_camera(described))
    camera = calibration.of(first)
    if any(camera.distortion):
        raise TrainingDataError(f"{folder}: AirSim's cameras have no distortion, the calibration has one")
    vehicles = _by_vehicle(frames)
    return [
        AirSimRecording(folder.name if len(vehicles) == 1 else f"{folder.name}/{vehicle}", camera, tuple(own))
        for vehicle, own in sorted(vehicles.items())
    ]


def _by_vehicle(frames: Sequence[RecordedFrame]) -> dict[str, list[RecordedFrame]]:
    """The lines of each vehicle; a broken line is a gap in the vehicle's recording that it stands in."""
    vehicles: dict[str, list[RecordedFrame]] = {}
    vehicle = next((frame.vehicle for frame in frames if frame.vehicle is not None), "")
    for frame in frames:
        vehicle = vehicle if frame.vehicle is None else frame.vehicle
        vehicles.setdefault(vehicle, []).append(frame)
    return vehicles


def _read_recording(folder: Path) -> tuple[RecordedFrame, ...]:
    path = folder / RECORDING
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise TrainingDataError(f"cannot read {path}: {error}") from error
    header = lines[0].split("\t") if lines else []
    columns = {name.strip(): position for position, name in enumerate(header)}
    missing = [name for name in (*_POSE, _PICTURES) if name not in columns]
    if missing:
        raise TrainingDataError(f"{path} has no column {', '.join(missing)} in its first line")
    return tuple(
        _read_line(folder, number, line, columns)
        for number, line in enumerate(lines[1:], start=2)
        if line.strip()
    )


def _read_line(folder: Path, number: int, line: str, columns: dict[str, int]) -> RecordedFrame:
    fields = line.split("\t")
    recording = folder / RECORDING
    if len(fields) < len(columns):
        return RecordedFrame(
            recording, trouble=f"line {number} has {len(fields)} fields instead of {len(columns)}"
        )
    try:
        pose = tuple(float(fields[columns[name]]) for name in _POSE)
    except ValueError as error:
        return RecordedFrame(recording, trouble=f"line {number}: {error}")
    if not all(math.isfinite(value) for value in pose) or not any(pose[3:]):
        return RecordedFrame(recording, trouble=f"line {number} has no pose: {pose}")
    names = [name.strip() for name in fields[columns[_PICTURES]].split(";") if name.strip()]
    pictures = [name for name in names if _is_picture(name)]
    if not pictures:
        return RecordedFrame(recording, trouble=f"line {number} names no picture")
    depth = next((name for name in names if _is_depth_of(name, pictures[0])), None)
    images = folder / IMAGES
    return RecordedFrame(
        images / pictures[0],
        images / depth if depth is not None else None,
        depth is not None and _image_type(depth) == _DEPTH_PERSPECTIVE,
        pose,
        vehicle=fields[columns[_VEHICLE]].strip() if _VEHICLE in columns else "",
    )


def _image_type(name: str) -> int | None:
    """AirSim's image type, if the file is named by AirSim."""
    match = _NAMED_BY_AIRSIM.match(Path(name).stem)
    return int(match["type"]) if match else None


def _is_picture(name: str) -> bool:
    return Path(name).suffix.lower() in PICTURE_SUFFIXES and _image_type(name) in (None, _SCENE)


def _is_depth_of(name: str, picture: str) -> bool:
    """Whether a file is depth, and of the picture's camera where the names tell cameras apart."""
    kind = _image_type(name)
    if Path(name).suffix.lower() != ".pfm" or kind not in (None, _DEPTH_PLANAR, _DEPTH_PERSPECTIVE):
        return False
    own, other = (_NAMED_BY_AIRSIM.match(Path(each).stem) for each in (name, picture))
    return own is None or other is None or own["camera"] == other["camera"]
