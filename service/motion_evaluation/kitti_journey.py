"""KITTI's drives as journeys: a car for a vehicle, its navigation for an autopilot, LiDAR for the truth."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from service.errors import RecordError
from service.motion_evaluation.journey import Journey, Moment, Said
from uavdepth.attitude import Attitude
from uavdepth.camera import BODY_FROM_CAMERA_AXES, CameraModel, CameraMount

if TYPE_CHECKING:
    from training.sequences.kitti_odometry import KittiOdometrySequence
    from training.sequences.kitti_raw import KittiDrive
    from training.sequences.oxts import Oxts

_Source = TypeVar("_Source", "KittiDrive", "KittiOdometrySequence")

_PERIOD_NS = 103_500_000
"""KITTI's cameras make a picture in 0.1035 s, not in 0.1 s."""


def open_kitti(folder: Path) -> list[Journey]:
    """Every drive of a folder of raw data or sequence of a folder of odometry data.

    Raises:
        RecordError: neither is there, or nothing says how the car moved.
    """
    from training.errors import TrainingDataError
    from training.sequences.kitti_odometry import open_kitti_odometry
    from training.sequences.kitti_raw import open_kitti_raw

    try:
        if any(folder.glob("calib.txt")) or any(folder.glob("*/calib.txt")) or any(folder.glob("sequences")):
            found: list[Journey] = [
                OdometryJourney(each) for each in open_kitti_odometry(folder) if each.poses is not None
            ]
        else:
            found = [RawJourney(each) for each in open_kitti_raw(folder) if each.oxts(0) is not None]
    except TrainingDataError as error:
        raise RecordError(f"{folder}: {error}") from error
    if not found:
        raise RecordError(f"{folder}: no sequence says how the car moved (oxts or poses)")
    return found


@dataclass(frozen=True)
class _KittiJourney(Generic[_Source]):
    """What both kinds of data have in common: name and camera are those of the source."""

    source: _Source
    group: str
    mount: CameraMount = field(default_factory=CameraMount)

    @property
    def name(self) -> str:
        """What it is called in the report."""
        return self.source.name

    @property
    def camera(self) -> CameraModel:
        """Of the rectified pictures."""
        return self.source.camera


@dataclass(frozen=True)
class RawJourney(_KittiJourney["KittiDrive"]):
    """A drive of the raw data: attitude and speed from its oxts files."""

    group: str = "kitti raw"

    def moments(self) -> Iterator[Moment]:
        """Every picture that has a record of the motion."""
        position, before_ns = np.zeros(3), 0
        for number, at_ns in enumerate(_exposures_ns(self.source)):
            oxts = self.source.oxts(number)
            if oxts is None:
                continue
            attitude, velocity = _flown(oxts)
            position = position + velocity * (at_ns - before_ns) * 1e-9
            before_ns = at_ns
            said = (Said(at_ns, attitude, position, velocity),)
            speed = float(np.linalg.norm(velocity))
            yield Moment(at_ns, self.source.image_bgr(number), self.source.truth_m(number), said, None, speed)


@dataclass(frozen=True)
class OdometryJourney(_KittiJourney["KittiOdometrySequence"]):
    """A sequence of the odometry data: everything from its poses."""

    group: str = "kitti odometry"

    def moments(self) -> Iterator[Moment]:
        """Every picture."""
        poses = [self.source.world_from_camera(number) for number in range(len(self.source))]
        # The first camera's axes are taken for the world's: north is where it looked.
        positions = np.array([BODY_FROM_CAMERA_AXES @ pose[:3, 3] for pose in poses])
        velocities = np.gradient(positions, _PERIOD_NS * 1e-9, axis=0)
        for number, pose in enumerate(poses):
            at_ns = number * _PERIOD_NS
            ned_from_body = BODY_FROM_CAMERA_AXES @ pose[:3, :3] @ BODY_FROM_CAMERA_AXES.T
            said = (Said(at_ns, _attitude(ned_from_body), positions[number], velocities[number]),)
            speed = float(np.linalg.norm(velocities[number]))
            truth = self.source.truth_m(number)
            yield Moment(at_ns, self.source.image_bgr(number), truth, said, None, speed)


def _exposures_ns(drive: KittiDrive) -> list[int]:
    """Times of the pictures since the first."""
    path = drive.file_of(0).parents[1] / "timestamps.txt"
    count = len(drive)
    if path.is_file():
        clock = [line.split()[-1] for line in path.read_text(encoding="ascii").splitlines() if line.strip()]
        seconds = [float(np.dot([3600, 60, 1], [float(part) for part in each.split(":")])) for each in clock]
        first = drive.first_number if len(seconds) > count else 0
        if len(seconds) >= first + count:
            return [round((each - seconds[first]) * 1e9) for each in seconds[first : first + count]]
    return [number * _PERIOD_NS for number in range(count)]


def _flown(oxts: Oxts) -> tuple[Attitude, NDArray[np.float64]]:
    """Attitude and velocity against NED of a record that is against east, north, up."""
    yaw_rad = math.remainder(math.pi / 2 - oxts.yaw_rad, 2 * math.pi)
    attitude = Attitude(oxts.roll_rad, -oxts.pitch_rad, yaw_rad)
    body = np.array([oxts.forward_m_s, -oxts.left_m_s, -oxts.up_m_s])
    return attitude, attitude.ned_from_body @ body


def _attitude(ned_from_body: NDArray[np.float64]) -> Attitude:
    """Roll, pitch and yaw of a rotation matrix."""
    return Attitude(
        math.atan2(ned_from_body[2, 1], ned_from_body[2, 2]),
        -math.asin(min(1.0, max(-1.0, float(ned_from_body[2, 0])))),
        math.atan2(ned_from_body[1, 0], ned_from_body[0, 0]),
    )
