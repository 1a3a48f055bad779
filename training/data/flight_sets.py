"""Flights through rendered worlds, written as AirSim writes its recordings.

The sets of the comparison: the scenes, counts, picture size and intrinsics of the AirSim sets in Wei, Ding
and Li 2025 (section 3.1, equation 12). Training and test worlds have different seeds, so no test picture
shows a place that a network was trained on.
"""

from __future__ import annotations

import json
import zlib
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from training.errors import TrainingDataError
from training.sequences.pfm import write_pfm
from uavdepth.camera import CameraModel, CameraMount
from uavdepth.scenes import Scene, load_scene
from uavdepth.scenes.flight import Pose

AIRSIM_CAMERA = CameraModel(640, 480, fx=320.0, fy=359.185, cx=320.0, cy=240.0)
"""Wei, Ding and Li 2025, equation 12."""

FRAMES_PER_S = 8.0
"""At flights of 2 to 9 m/s the camera moves 0.25 to 1.1 m a frame, as in KITTI's 10 frames a second."""

RECORDING = "airsim_rec.txt"
PICTURES = "images"
CAMERA = "camera.json"
_HEADER = "VehicleName\tTimeStamp\tPOS_X\tPOS_Y\tPOS_Z\tQ_W\tQ_X\tQ_Y\tQ_Z\tImageFile\n"
_FAST_PNG = [cv2.IMWRITE_PNG_COMPRESSION, 1]
_VEHICLE = "uav"


@dataclass(frozen=True)
class FlightSet:
    """One set of recordings, one flight through each of its worlds.

    Args:
        scene: name of the scene.
        first_seed, worlds: seeds of the worlds.
        frames: how many pictures the flights have together.
        with_depth: whether the exact depth is stored; self-supervised training needs none.
    """

    scene: str
    first_seed: int
    worlds: int
    frames: int
    with_depth: bool

    def flights(self) -> Iterator[tuple[int, int]]:
        """Seed and number of frames of each flight; together exactly `frames`."""
        each, more = divmod(self.frames, self.worlds)
        for index in range(self.worlds):
            yield self.first_seed + index, each + (index < more)


COMPARISON_SETS = {
    "mountain-train": FlightSet("mountain", 0, 20, 3986, with_depth=False),
    "city-train": FlightSet("city", 0, 16, 3174, with_depth=False),
    "mountain-test": FlightSet("mountain", 1000, 8, 1453, with_depth=True),
    "city-test": FlightSet("city", 1000, 7, 1206, with_depth=True),
}
"""Counts of the paper's section 3.1."""


def write_flight_set(
    root: Path, wanted: FlightSet, done: Callable[[Path, int], None] | None = None
) -> list[Path]:
    """Render what is missing of a set.

    Args:
        root: folder that gets one recording a world.
        wanted: the set.
        done: called with folder and number of frames after each recording.

    Returns:
        The recordings' folders.

    Raises:
        SceneError: a world that cannot be built or flown through.
        TrainingDataError: a folder that cannot be written.
    """
    folders = []
    for seed, frames in wanted.flights():
        folder = root / f"{wanted.scene}-{seed:06d}"
        folders.append(folder)
        if (folder / RECORDING).exists():
            continue
        write_recording(folder, load_scene(wanted.scene, seed), frames, with_depth=wanted.with_depth)
        if done is not None:
            done(folder, frames)
    return folders


def write_recording(folder: Path, scene: Scene, frames: int, *, with_depth: bool) -> None:
    """Render one flight; the list of its frames comes last, so that no reader sees half of it."""
    pictures = folder / PICTURES
    try:
        pictures.mkdir(parents=True, exist_ok=True)
        (folder / CAMERA).write_text(json.dumps(asdict(AIRSIM_CAMERA)), encoding="utf-8")
    except OSError as error:
        raise TrainingDataError(f"cannot write the recording {folder}: {error.strerror}") from error
    # crc32 keeps flights of equal seeds in different scenes apart, and is the same on every machine.
    flight = scene.flight(zlib.crc32(scene.name.encode()) ^ scene.seed, frames / FRAMES_PER_S)
    lines = [_HEADER]
    for index in range(frames):
        pose = flight.at(index / FRAMES_PER_S)
        picture = scene.render(AIRSIM_CAMERA, CameraMount(), pose.position_ned_m.tolist(), pose.attitude)
        names = [f"img_{index:05d}.png"]
        _write(cv2.imwrite(str(pictures / names[0]), picture.image_bgr, _FAST_PNG), pictures / names[0])
        if with_depth:
            names.append(f"depth_{index:05d}.pfm")
            write_pfm(pictures / names[1], picture.depth_m)
        lines.append(_line(index, pose, names))
    partial = folder / (RECORDING + ".part")
    partial.write_text("".join(lines), encoding="utf-8")
    partial.replace(folder / RECORDING)


def _line(index: int, pose: Pose, names: list[str]) -> str:
    """One line of airsim_rec.txt: NED position, attitude as a quaternion, files by semicolons."""
    values = [*pose.position_ned_m, *_quaternion(pose.attitude.ned_from_body)]
    numbers = "\t".join(f"{value:.9g}" for value in values)
    return f"{_VEHICLE}\t{round(1000 * index / FRAMES_PER_S)}\t{numbers}\t{';'.join(names)}\n"


def _quaternion(rotation: NDArray[np.float64]) -> NDArray[np.float64]:
    """(4,) w, x, y, z of a rotation matrix, w >= 0."""
    vector = cv2.Rodrigues(rotation)[0].ravel()
    angle = float(np.linalg.norm(vector))
    axis = vector / angle if angle > 0 else np.zeros(3)
    return np.concatenate([[np.cos(angle / 2)], np.sin(angle / 2) * axis])


def _write(written: bool, path: Path) -> None:
    if not written:
        raise TrainingDataError(f"cannot write {path}: is the disk full?")
