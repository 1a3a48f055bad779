"""A recorded flight replayed through a rendered world: true poses, and what the autopilot said of them."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from service.errors import RecordError
from service.motion_evaluation.journey import Moment, Said
from service.motion_evaluation.rendered_journey import CAMERA, MOUNT
from service.motion_evaluation.rendering import rendered_moments
from uavdepth.attitude import Attitude
from uavdepth.camera import CameraModel, CameraMount
from uavdepth.scenes import Scene, load_scene
from uavdepth.scenes.flight import Pose

_PLACES = 400
_CLEARANCE_M = 1.5
_NEAREST_THING_M = 25.0
"""A place is taken only where most pictures have something so near: over empty land nothing is measured."""


@dataclass(frozen=True, eq=False)
class Recording:
    """A simulated flight of ArduPilot: `NAME.BIN` knows the truth, `NAME.tlog` what was said.

    Args:
        attitudes: (N, 4) seconds since boot; true roll, pitch, yaw in radians, 10 a second.
        motions: (M, 7) seconds since boot; true position and velocity, NED.
        said: what arrived, by the autopilot's own time stamps.
    """

    attitudes: NDArray[np.float64]
    motions: NDArray[np.float64]
    said: tuple[Said, ...]

    def pose(self, t_s: float) -> Pose:
        """The true pose; between rows cubic in position and linear in the angles."""
        angles = [np.interp(t_s, self.attitudes[:, 0], np.unwrap(self.attitudes[:, k])) for k in (1, 2, 3)]
        index = int(np.clip(np.searchsorted(self.motions[:, 0], t_s) - 1, 0, len(self.motions) - 2))
        first, second = self.motions[index], self.motions[index + 1]
        step = second[0] - first[0]
        u = float(np.clip((t_s - first[0]) / step, 0.0, 1.0))
        position = (
            (2 * u**3 - 3 * u**2 + 1) * first[1:4]
            + (u**3 - 2 * u**2 + u) * step * first[4:7]
            + (3 * u**2 - 2 * u**3) * second[1:4]
            + (u**3 - u**2) * step * second[4:7]
        )
        velocity = (1 - u) * first[4:7] + u * second[4:7]
        roll, pitch, yaw = (float(angle) for angle in angles)
        return Pose(position, velocity, Attitude(roll, pitch, math.remainder(yaw, 2 * math.pi)))


@lru_cache(maxsize=2)
def read_recording(log: Path) -> Recording:
    """Read `NAME.BIN` and the `NAME.tlog` beside it.

    Raises:
        RecordError: a file that is missing, or one without the rows and messages that are needed.
    """
    from pymavlink import DFReader

    for path in (log, log.with_suffix(".tlog")):
        if not path.is_file():
            raise RecordError(f"no recorded flight at {path}: NAME.BIN and NAME.tlog are needed")
    rows: dict[str, list[tuple[float, ...]]] = {"SIM": [], "SIM2": []}
    reader = DFReader.DFReader_binary(str(log))
    while (row := reader.recv_match(type=list(rows))) is not None:
        at_s = row.TimeUS * 1e-6
        if row.get_type() == "SIM":
            rows["SIM"].append((at_s, *(math.radians(each) for each in (row.Roll, row.Pitch, row.Yaw))))
        else:
            rows["SIM2"].append((at_s, row.PN, row.PE, row.PD, row.VN, row.VE, row.VD))
    said = tuple(_said(log.with_suffix(".tlog")))
    if min(len(rows["SIM"]), len(rows["SIM2"])) < 2 or not said:
        raise RecordError(f"{log}: SIM and SIM2 rows, ATTITUDE and LOCAL_POSITION_NED are needed")
    return Recording(np.array(rows["SIM"]), np.array(rows["SIM2"]), said)


def _said(tlog: Path) -> Iterator[Said]:
    """ATTITUDE and LOCAL_POSITION_NED at the autopilot's own time stamps."""
    from pymavlink.dialects.v20 import ardupilotmega as mavlink

    codec = mavlink.MAVLink(None)
    data, at = tlog.read_bytes(), 0
    wanted = (mavlink.MAVLINK_MSG_ID_ATTITUDE, mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED)
    while at + 18 <= len(data):
        length = data[at + 9] + (25 if data[at + 10] & 1 else 12)
        frame = data[at + 8 : at + 8 + length]
        at += 8 + length
        if int.from_bytes(frame[7:10], "little") not in wanted:
            continue
        message = codec.decode(bytearray(frame))
        at_ns = message.time_boot_ms * 1_000_000
        if message.get_type() == "ATTITUDE":
            yield Said(at_ns, attitude=Attitude(message.roll, message.pitch, message.yaw))
        else:
            position = np.array([message.x, message.y, message.z], np.float64)
            velocity = np.array([message.vx, message.vy, message.vz], np.float64)
            yield Said(at_ns, position_ned_m=position, velocity_ned_mps=velocity)


class _RecordedAutopilot:
    """Says again what it said then; its rangefinder looks at the rendered world."""

    def __init__(self, recording: Recording, start_s: float) -> None:
        self._said = sorted(recording.said, key=lambda each: each.at_ns)
        self._times = [each.at_ns for each in self._said]
        self._next = bisect_right(self._times, round(start_s * 1e9))
        self._attitudes = np.array(
            [
                (each.at_ns * 1e-9, each.attitude.roll_rad, each.attitude.pitch_rad, each.attitude.yaw_rad)
                for each in self._said
                if each.attitude is not None
            ]
        )

    def until(self, t_s: float) -> tuple[Said, ...]:
        """What it said from where it stopped up to `t_s`, in order of time."""
        end = bisect_right(self._times, round(t_s * 1e9))
        said, self._next = tuple(self._said[self._next : end]), max(self._next, end)
        return said

    def attitude(self, t_s: float) -> Attitude:
        """What it believed its attitude to be."""
        at = self._attitudes
        index = int(np.argmin(np.abs(at[:, 0] - t_s)))
        return Attitude(*at[index, 1:].tolist())

    def range_m(self, true_m: float) -> float:
        """The simulator's rangefinder has no error of its own."""
        return true_m


@dataclass(frozen=True)
class RecordedJourney:
    """A part of a recorded flight, set down where a rendered world leaves room for it.

    The whole path is moved, never turned or stretched, so that all that was said of it stays as it was but
    for one constant offset of the position, which nothing here uses.

    Args:
        log: NAME.BIN, with NAME.tlog beside it.
        scene: rendered world, NAME:SEED.
        title: what happens in it.
        start_s, seconds: which part, seconds since the first SIM row.
    """

    log: Path
    scene: str
    title: str
    start_s: float
    seconds: float
    camera: CameraModel = CAMERA
    mount: CameraMount = MOUNT
    group: str = "recorded"

    @property
    def name(self) -> str:
        """Recording, part and scene."""
        return f"{self.log.stem} {self.title}, {self.scene}"

    def moments(self) -> Iterator[Moment]:
        """A picture at each SIM row.

        Raises:
            RecordError: a recording that cannot be read, too short a one, or no room in the world.
        """
        recording = read_recording(self.log)
        times_s = recording.attitudes[:, 0]
        times_s = times_s[times_s >= times_s[0] + self.start_s]
        times_s = times_s[times_s < times_s[0] + self.seconds] if len(times_s) else times_s
        if len(times_s) < 2:
            raise RecordError(f"{self.log} ends before {self.start_s:g} s")
        name, _, seed = self.scene.partition(":")
        scene = load_scene(name, int(seed or 0))
        offset = _place(scene, recording, times_s)
        if offset is None:
            raise RecordError(f"{self.scene} has no room for {self.title} of {self.log.name}")

        def pose_at(t_s: float) -> Pose:
            pose = recording.pose(t_s)
            return Pose(pose.position_ned_m + offset, pose.velocity_ned_mps, pose.attitude)

        autopilot = _RecordedAutopilot(recording, float(times_s[0]) - 0.5)
        return rendered_moments(scene, self.camera, self.mount, pose_at, autopilot, times_s)


def _place(scene: Scene, recording: Recording, times_s: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """Offset (3,) NED that keeps the path clear of everything and near to something."""
    rng = np.random.default_rng(7)
    poses = [recording.pose(t_s) for t_s in times_s[:: max(1, len(times_s) // 20)].tolist()]
    path = np.array([pose.position_ned_m for pose in poses])
    for _ in range(_PLACES):
        north, east = rng.uniform(-0.7, 0.7, 2) * scene.extent_m
        height_m = rng.uniform(2.5, 8.0)
        start = np.array([north, east, -scene.ground_height_m(north, east) - height_m])
        moved = path + (start - path[0])
        if np.abs(moved[:, :2]).max() > scene.extent_m:
            continue
        if _is_near_things(scene, moved, poses) and all(
            scene.clearance_m(point.tolist()) > _CLEARANCE_M for point in moved
        ):
            return np.asarray(start - path[0])
    return None


def _is_near_things(scene: Scene, path: NDArray[np.float64], poses: list[Pose]) -> bool:
    """Whether level rays ahead meet something on most of the way."""
    met = 0
    for point, pose in zip(path, poses, strict=True):
        yaw = pose.attitude.yaw_rad + np.radians([-30.0, -15.0, 0.0, 15.0, 30.0])
        rays = np.stack([np.cos(yaw), np.sin(yaw), np.zeros(5)], axis=1)
        reach = scene.ray_distance_m(np.repeat(point[None], 5, axis=0), rays)
        met += int(np.count_nonzero(reach < _NEAREST_THING_M) >= 2)
    return met >= 0.7 * len(path)
