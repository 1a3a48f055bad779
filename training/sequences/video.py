"""Video files."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from training.errors import TrainingDataError
from training.sequences.calibration import NO_CALIBRATION, Calibration
from training.sequences.errors import BrokenFrameError
from training.sequences.pictures import require_size
from training.sequences.rectifier import Rectifier
from uavdepth.camera import CameraModel

VIDEO_SUFFIXES = (".mp4", ".mkv", ".avi", ".mov", ".m4v", ".webm")


@dataclass(frozen=True)
class VideoFile:
    """A `StreamedSequence` of a video's frames, without any truth.

    Args:
        path: the file.
        lens: the camera as calibrated.
        count: frames, as far as they could be decoded.
        rectifier: takes the lens's distortion out.
    """

    path: Path
    lens: CameraModel
    count: int
    rectifier: Rectifier

    @property
    def name(self) -> str:
        """Of the file."""
        return self.path.stem

    @property
    def camera(self) -> CameraModel:
        """Of the rectified pictures."""
        return self.rectifier.camera

    def __len__(self) -> int:
        return self.count

    def file_of(self, index: int) -> Path:
        """The video itself."""
        return self.path

    def problem(self, index: int) -> str | None:
        """None: all frames were decoded when the file was opened."""
        return None

    def image_bgr(self, index: int) -> NDArray[np.uint8]:
        """(H, W, 3) rectified picture; every frame before it is decoded too, so prefer `images_bgr`.

        Raises:
            BrokenFrameError: it cannot be decoded or is of another size.
        """
        with _opened(self.path) as capture:
            for _ in range(index):
                capture.grab()
            done, picture = capture.read()
        if not done:
            raise BrokenFrameError(f"cannot decode frame {index} of {self.path}")
        return self._rectified(np.asarray(picture, np.uint8))

    def images_bgr(self) -> Iterator[NDArray[np.uint8]]:
        """All pictures in order. Raises BrokenFrameError: one is of another size."""
        with _opened(self.path) as capture:
            for _ in range(self.count):
                done, picture = capture.read()
                if not done:
                    return
                yield self._rectified(np.asarray(picture, np.uint8))

    def truth_m(self, index: int) -> NDArray[np.float32] | None:
        """None: nothing is known."""
        return None

    def _rectified(self, picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
        require_size(self.path, picture.shape[:2], self.lens)
        return self.rectifier.apply(picture)


def open_video(path: Path, calibration: Calibration = NO_CALIBRATION) -> list[VideoFile]:
    """A video file, or all videos of a folder, sorted.

    Every frame is decoded once to count them: what a file says of its length is often wrong.

    Raises:
        TrainingDataError: no video, one that cannot be decoded, no calibration, or one for another size.
    """
    if path.is_dir():
        files = sorted(each for each in path.iterdir() if each.suffix.lower() in VIDEO_SUFFIXES)
        if not files:
            raise TrainingDataError(f"no videos ({', '.join(VIDEO_SUFFIXES)}) in {path}")
        return [_open_file(file, calibration) for file in files]
    if not path.is_file():
        raise TrainingDataError(f"no video at {path}")
    return [_open_file(path, calibration)]


def _open_file(path: Path, calibration: Calibration) -> VideoFile:
    with _opened(path) as capture:
        done, picture = capture.read()
        if not done:
            raise TrainingDataError(f"cannot decode the video {path}")
        count = 1
        while capture.grab():
            count += 1
    height, width = picture.shape[:2]
    lens = calibration.of_size(width, height, str(path))
    return VideoFile(path, lens, count, Rectifier(lens))


@contextmanager
def _opened(path: Path) -> Iterator[cv2.VideoCapture]:
    capture = cv2.VideoCapture(str(path))
    try:
        yield capture
    finally:
        capture.release()
