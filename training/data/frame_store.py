"""A folder of rendered frames: one sub-folder per scene seed, complete once its list is there."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from training.data.depth_code import decode_depth16, encode_depth16
from training.errors import TrainingDataError
from uavdepth.attitude import Attitude
from uavdepth.camera import CameraModel, CameraMount

_LIST = "frames.json"
_JPEG_QUALITY = 95


@dataclass(frozen=True)
class FrameRecord:
    """What is known of one stored frame besides its pixels.

    Args:
        folder, name: where its files lie.
        scene, seed: the world it shows.
        camera, mount, attitude: of the picture.
        height_m: of the camera above whatever is straight below; None if nothing is.
    """

    folder: Path
    name: str
    scene: str
    seed: int
    camera: CameraModel
    mount: CameraMount
    attitude: Attitude
    height_m: float | None

    def image_bgr(self) -> NDArray[np.uint8]:
        """(H, W, 3) picture. Raises TrainingDataError: a file that is missing, broken or of another size."""
        return self._read(".jpg", cv2.IMREAD_COLOR).astype(np.uint8, copy=False)

    def depth_m(self) -> NDArray[np.float32]:
        """(H, W) exact z-depth, +inf for sky. Raises TrainingDataError as `image_bgr`."""
        return decode_depth16(self._read(".png", cv2.IMREAD_UNCHANGED).astype(np.uint16))

    def _read(self, suffix: str, flags: int) -> NDArray[np.generic]:
        path = self.folder / (self.name + suffix)
        picture = cv2.imread(str(path), flags)
        if picture is None:
            raise TrainingDataError(f"cannot read the training frame {path}")
        height, width = picture.shape[:2]
        if (width, height) != (self.camera.width, self.camera.height):
            raise TrainingDataError(
                f"{path} is {width}x{height} pixels, its camera is {self.camera.width}x{self.camera.height}"
            )
        return np.asarray(picture)


@dataclass(frozen=True)
class NewFrame:
    """A frame on its way into the store; fields as in `FrameRecord`."""

    image_bgr: NDArray[np.uint8]
    depth_m: NDArray[np.float32]
    camera: CameraModel
    mount: CameraMount
    attitude: Attitude
    height_m: float | None


def write_frames(root: Path, scene: str, seed: int, frames: Sequence[NewFrame]) -> Path:
    """Store the frames of one scene seed; the list comes last, so that a reader never sees half of them.

    Returns:
        The folder that was written.

    Raises:
        TrainingDataError: a depth that is NaN or not above 0, which no renderer gives.
    """
    folder = frames_folder(root, scene, seed)
    for index, frame in enumerate(frames):
        wrong = int(np.count_nonzero(~(frame.depth_m > 0)))
        if wrong:
            raise TrainingDataError(
                f"frame {index} of {scene}:{seed} has {wrong} pixels whose depth is NaN or not above 0 m"
            )
    folder.mkdir(parents=True, exist_ok=True)
    entries = []
    for index, frame in enumerate(frames):
        name = f"{index:04d}"
        cv2.imwrite(str(folder / f"{name}.jpg"), frame.image_bgr, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])
        cv2.imwrite(str(folder / f"{name}.png"), encode_depth16(frame.depth_m))
        entries.append(
            {
                "name": name,
                "camera": asdict(frame.camera),
                "mount": asdict(frame.mount),
                "attitude": asdict(frame.attitude),
                "height_m": frame.height_m,
            }
        )
    partial = folder / (_LIST + ".part")
    partial.write_text(json.dumps({"scene": scene, "seed": seed, "frames": entries}))
    partial.replace(folder / _LIST)
    return folder


def frames_folder(root: Path, scene: str, seed: int) -> Path:
    """Where the frames of one scene seed lie."""
    return root / f"{scene}-{seed:06d}"


def has_frames(root: Path, scene: str, seed: int) -> bool:
    """Whether a scene seed is complete."""
    return (frames_folder(root, scene, seed) / _LIST).is_file()


def read_frames(root: Path) -> list[FrameRecord]:
    """Every complete frame below `root`, in the order of scene, seed and name.

    Raises:
        TrainingDataError: no such folder, or a list that cannot be read.
    """
    return FrameStore(root).frames()


class FrameStore:
    """The frames below a folder, read again and again while a renderer adds to them.

    A list is complete once it is there, so each is read only once.
    """

    def __init__(self, root: Path) -> None:
        self.root = root
        self._lists: dict[Path, list[FrameRecord]] = {}

    def frames(self) -> list[FrameRecord]:
        """As `read_frames`."""
        if not self.root.is_dir():
            raise TrainingDataError(f"no folder of training frames at {self.root}")
        paths = sorted(self.root.glob(f"*/{_LIST}"))
        self._lists = {path: self._lists.get(path) or list(_read_list(path)) for path in paths}
        return [record for records in self._lists.values() for record in records]


def _read_list(path: Path) -> Iterator[FrameRecord]:
    try:
        listing = json.loads(path.read_text())
        for entry in listing["frames"]:
            entry["camera"]["distortion"] = tuple(entry["camera"]["distortion"])
            yield FrameRecord(
                path.parent,
                entry["name"],
                listing["scene"],
                listing["seed"],
                CameraModel(**entry["camera"]),
                CameraMount(**entry["mount"]),
                Attitude(**entry["attitude"]),
                entry["height_m"],
            )
    except (KeyError, TypeError, json.JSONDecodeError) as error:
        raise TrainingDataError(f"{path} is not a list of training frames: {error!r}") from error
