"""A video or a folder of pictures with a telemetry log from the same flight."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from service.cameras.camera import PictureSizeError, fit_picture
from service.cameras.image_folder import PICTURE_SUFFIXES, natural_order
from service.errors import RecordError
from service.recorder.perception_note import PerceptionNote
from service.replay.dataflash_file import read_dataflash
from service.replay.footage import Packets, RecordedPicture
from service.replay.tlog_file import read_tlog
from service.replay.ulog_file import read_ulog
from service.settings.camera import CameraSettings

STAMPS = "timestamps.txt"
"""In a folder of pictures: one capture time a line, seconds, in the order of the names."""

_DONE_NS = 100_000_000
"""Pictures count as measured so long after their capture: what the autopilot said by then is known."""

_BARE_STREAMS = frozenset({".mjpeg", ".mjpg", ".h264", ".264", ".h265", ".265", ".hevc", ".m4v", ".yuv"})
"""Streams without a container: FFmpeg makes up 25 pictures a second for them."""

_LEAST_OVERLAP_NS = 100_000_000
_MOST_PICTURES = 10_000_000
_READERS: dict[str, Callable[[Path], list[Packets]]] = {
    ".tlog": read_tlog,
    ".bin": read_dataflash,
    ".ulg": read_ulog,
}


class LooseFootage:
    """Pictures and telemetry that were recorded apart.

    The log's clock is the clock of the replay; the first picture was taken `offset_s` after the log begins.

    Args:
        pictures: a video file or a folder.
        telemetry: a .tlog, .BIN or .ulg.
        camera: size and calibration.
        fps: pictures a second, where neither video nor folder has times.
        offset_s: seconds.

    Raises:
        RecordError: files that cannot be read, pictures without times, or telemetry of another time.
    """

    def __init__(
        self,
        pictures: Path,
        telemetry: Path,
        camera: CameraSettings,
        *,
        fps: float | None = None,
        offset_s: float = 0.0,
    ) -> None:
        self._pictures = pictures
        self._camera = camera
        if not math.isfinite(offset_s):
            raise RecordError(f"--offset {offset_s}: a finite number of seconds is needed")
        self._packets = _READERS[telemetry.suffix.lower()](telemetry)
        self._times_s = _folder_times(pictures, fps) if pictures.is_dir() else _video_times(pictures, fps)
        log_ns = self._packets[0].at_ns, self._packets[-1].at_ns
        self._first_ns = log_ns[0] + round(offset_s * 1e9)
        last_ns = self._first_ns + round(self._times_s[-1] * 1e9)
        self.warnings: list[str] = []
        """What is wrong and does not keep it from being played."""
        self._check_overlap(telemetry, log_ns, (self._first_ns, last_ns))

    @property
    def name(self) -> str:
        """The pictures' name."""
        return self._pictures.name

    @property
    def packets(self) -> Sequence[Packets]:
        """The log as MAVLink."""
        return self._packets

    def pictures(self) -> Iterator[RecordedPicture]:
        """The pictures at the calibrated size."""
        source = (
            _folder_pictures(self._pictures) if self._pictures.is_dir() else _video_pictures(self._pictures)
        )
        for index, (image, seconds) in enumerate(zip(source, self._times_s, strict=False)):
            captured_ns = self._first_ns + round(seconds * 1e9) - round(self._camera.latency_ms * 1e6)
            try:
                fitted = fit_picture(image, self._camera, self.name)
            except PictureSizeError as error:
                raise RecordError(str(error)) from error
            note = PerceptionNote(
                index=index, captured_ns=captured_ns, begun_ns=captured_ns, done_ns=captured_ns + _DONE_NS
            )
            yield RecordedPicture(note, fitted)

    def _check_overlap(self, telemetry: Path, log_ns: tuple[int, int], film_ns: tuple[int, int]) -> None:
        log_s = (log_ns[1] - log_ns[0]) / 1e9
        film = [(at_ns - log_ns[0]) / 1e9 for at_ns in film_ns]
        overlap_ns = min(log_ns[1], film_ns[1]) - max(log_ns[0], film_ns[0])
        where = (
            f"{self._pictures.name} lasts from {film[0]:.1f} to {film[1]:.1f} s of {telemetry.name}, "
            f"which lasts {log_s:.1f} s"
        )
        if overlap_ns < min(_LEAST_OVERLAP_NS, film_ns[1] - film_ns[0]) or overlap_ns < 0:
            gap_s = -overlap_ns / 1e9
            raise RecordError(f"{where}: they miss each other by {gap_s:.1f} s; set --offset")
        outside_s = (film_ns[1] - film_ns[0] - overlap_ns) / 1e9
        if outside_s > 1.0:
            self.warnings.append(f"{where}: {outside_s:.1f} s of the pictures have no telemetry")


def _folder_times(folder: Path, fps: float | None) -> NDArray[np.float64]:
    count = len(_picture_paths(folder))
    stamps = folder / STAMPS
    if not stamps.is_file():
        if fps is None:
            raise RecordError(f"{folder}: its pictures have no times: give --fps, or {STAMPS} in it")
        return np.arange(count) / fps
    try:
        lines = stamps.read_text("ascii").split()
        times = np.array([float(line) for line in lines])
    except (OSError, ValueError) as error:
        raise RecordError(f"{stamps}: cannot be read as seconds, one a line: {error}") from error
    if len(times) != count:
        raise RecordError(f"{stamps}: {len(times)} times for {count} pictures")
    return _checked(times, str(stamps))


def _video_times(path: Path, fps: float | None) -> NDArray[np.float64]:
    """The pictures' times from the container, without decoding them."""
    if fps is None and path.suffix.lower() in _BARE_STREAMS:
        raise RecordError(f"{path}: a bare {path.suffix} stream carries no time stamps: give --fps")
    capture = _opened(path)
    times: list[float] = []
    try:
        while len(times) < _MOST_PICTURES and capture.grab():
            times.append(capture.get(cv2.CAP_PROP_POS_MSEC) / 1000.0)
    finally:
        capture.release()
    if not times:
        raise RecordError(f"{path}: holds no picture that can be read")
    if fps is not None:
        return np.arange(len(times)) / fps
    if len(times) > 1 and times[-1] <= times[0]:
        raise RecordError(f"{path}: its {len(times)} pictures carry no time stamps: give --fps")
    return _checked(np.array(times), str(path))


def _checked(times: NDArray[np.float64], name: str) -> NDArray[np.float64]:
    """Times from 0 on. Raises RecordError where they do not grow."""
    if not np.isfinite(times).all():
        raise RecordError(f"{name}: a time is not finite")
    back = np.flatnonzero(np.diff(times) <= 0)
    if back.size:
        k = int(back[0])
        raise RecordError(
            f"{name}: picture {k + 1} is stamped {times[k + 1]:.3f} s, the one before {times[k]:.3f} s: "
            "times must grow; --fps sets them"
        )
    return np.asarray(times - times[0])


def _picture_paths(folder: Path) -> list[Path]:
    found = [path for path in folder.iterdir() if path.suffix.lower() in PICTURE_SUFFIXES]
    if not found:
        raise RecordError(f"{folder}: no pictures in it ({', '.join(sorted(PICTURE_SUFFIXES))})")
    return sorted(found, key=natural_order)


def _folder_pictures(folder: Path) -> Iterator[NDArray[np.uint8]]:
    for path in _picture_paths(folder):
        image = cv2.imread(str(path), cv2.IMREAD_COLOR)
        if image is None:
            raise RecordError(f"{path}: is not a picture that can be read")
        yield np.asarray(image, np.uint8)


def _video_pictures(path: Path) -> Iterator[NDArray[np.uint8]]:
    capture = _opened(path)
    try:
        while True:
            read, image = capture.read()
            if not read:
                return
            yield np.asarray(image, np.uint8)
    finally:
        capture.release()


def _opened(path: Path) -> cv2.VideoCapture:
    capture = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG)
    if not capture.isOpened():
        capture.release()
        raise RecordError(f"{path}: is no video that can be read")
    return capture
