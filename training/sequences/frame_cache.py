"""Frames decoded and resized once, kept in memory-mapped files."""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import tempfile
import zlib
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from training.errors import TrainingDataError
from training.sequences.frame_sequence import FrameSequence, StreamedSequence

_FRAMES, _SUMS = "frames.u8", "sums.u64"
_FILLED = 1 << 32
"""Above the 32 bits of a checksum: tells a frame that is there from one that never was."""
_LAYOUT = "1"


class FrameCache:
    """The frames of one sequence at one size, filled as they are asked for.

    Two files hold the pixels and a checksum of each frame. A frame counts as there when its checksum fits,
    so a run that is killed while it writes costs that frame and no more, and several processes may fill the
    same cache. The folder's name says from which files (names, sizes, times) and to which size it was made:
    other pictures get another folder. It may be deleted at any time.

    Args:
        folder: where caches lie; made if it is not there.
        sequence: what is decoded.
        width, height: size of the kept frames in pixels.

    Raises:
        TrainingDataError: the folder cannot be written or the disk has no room.
    """

    def __init__(self, folder: Path, sequence: FrameSequence, width: int, height: int) -> None:
        self._sequence = sequence
        self._size = (width, height)
        home = folder / _folder_name(sequence, width, height)
        shape = (len(sequence), height, width, 3)
        try:
            if not home.is_dir():
                _create(home, frames_bytes=int(np.prod(shape)), sums_bytes=8 * len(sequence))
            self._frames = np.memmap(home / _FRAMES, np.uint8, "r+", shape=shape)
            self._sums = np.memmap(home / _SUMS, np.uint64, "r+", shape=(len(sequence),))
        except (OSError, ValueError) as error:
            raise TrainingDataError(
                f"cannot keep {int(np.prod(shape)) / 1e6:.0f} MB of decoded frames in {home}: {error}"
            ) from error
        self._trusted = np.zeros(len(sequence), bool)
        if isinstance(sequence, StreamedSequence):
            self._fill_in_order(sequence)

    def rgb(self, index: int) -> NDArray[np.uint8]:
        """(height, width, 3) RGB frame; a view of the cache, not to be written to.

        Raises:
            BrokenFrameError: the frame is not there yet and its picture cannot be read.
        """
        frame = self._frames[index]
        if not self._trusted[index]:
            if not self._has(index):
                self._keep(index, self._sequence.image_bgr(index))
            self._trusted[index] = True
        return np.asarray(frame)

    def _has(self, index: int) -> bool:
        return int(self._sums[index]) == _checksum(self._frames[index])

    def _keep(self, index: int, image_bgr: NDArray[np.uint8]) -> None:
        self._frames[index] = resized(image_bgr, *self._size)[:, :, ::-1]
        self._sums[index] = _checksum(self._frames[index])

    def _fill_in_order(self, sequence: StreamedSequence) -> None:
        if not all(self._has(index) for index in range(len(sequence))):
            for index, image_bgr in enumerate(sequence.images_bgr()):
                self._keep(index, image_bgr)


def resized(picture: NDArray[np.uint8], width: int, height: int) -> NDArray[np.uint8]:
    """The picture at another size: by area, so that fine texture does not alias; linear where it grows."""
    shrinks = width <= picture.shape[1] and height <= picture.shape[0]
    method = cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR
    return np.asarray(cv2.resize(picture, (width, height), interpolation=method), np.uint8)


def _checksum(frame: NDArray[np.uint8]) -> int:
    return _FILLED | zlib.crc32(np.ascontiguousarray(frame).data)


def _folder_name(sequence: FrameSequence, width: int, height: int) -> str:
    digest = hashlib.sha256(f"{_LAYOUT} {sequence.name} {sequence.camera}".encode())
    for index in range(len(sequence)):
        path = sequence.file_of(index)
        try:
            entry = path.stat()
            state = f"{entry.st_size} {entry.st_mtime_ns}"
        except OSError:
            state = "missing"
        digest.update(f"\n{path.name} {state}".encode())
    readable = re.sub(r"[^A-Za-z0-9]+", "-", sequence.name).strip("-")[-60:]
    return f"{readable}-{width}x{height}-{digest.hexdigest()[:16]}"


def _create(home: Path, frames_bytes: int, sums_bytes: int) -> None:
    """Make the folder in one step, so that no other process ever opens half of one."""
    home.parent.mkdir(parents=True, exist_ok=True)
    partial = Path(tempfile.mkdtemp(prefix=".part-", dir=home.parent))
    try:
        _reserve(partial / _FRAMES, frames_bytes)
        _reserve(partial / _SUMS, sums_bytes)
        partial.rename(home)
    except OSError:
        shutil.rmtree(partial, ignore_errors=True)
        if not home.is_dir():
            raise


def _reserve(path: Path, size: int) -> None:
    """A file of zeros whose room on the disk is taken: writing a mapped page without room is a bus error."""
    with path.open("wb") as file:
        if hasattr(os, "posix_fallocate"):
            os.posix_fallocate(file.fileno(), 0, size)
        else:
            block = bytes(1 << 20)
            for start in range(0, size, len(block)):
                file.write(block[: size - start])
