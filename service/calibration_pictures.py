"""Pictures for the calibration, each with a name: from a folder, a video or a live camera."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from service.cameras.camera import CameraEndedError, CameraTimeoutError
from service.cameras.image_folder import PICTURE_SUFFIXES, natural_order
from service.cameras.source import make_camera
from service.clock import Clock
from service.errors import CameraError, ConfigError
from service.settings.camera import CameraSettings
from service.telemetry import Telemetry
from uavdepth.camera import CameraMount
from uavdepth.errors import CalibrationError

_SIDES = (64, 4096)
"""Sizes that `[camera]` takes, pixels."""

_DUMMY_FOV_DEG = 90.0
"""The settings want a calibration; no one looks at it before there is one."""

_TIMEOUTS_IN_A_ROW = 5


@dataclass(frozen=True)
class NamedPicture:
    """A picture and what to call it.

    Args:
        name: its file, or its number in the video.
        image_bgr: (H, W, 3) uint8, or None where the file cannot be read.
    """

    name: str
    image_bgr: NDArray[np.uint8] | None


def is_live(source: str) -> bool:
    """Whether a source delivers for ever."""
    return not Path(source).expanduser().is_dir() and not Path(source).expanduser().is_file()


def read_pictures(
    source: str, every: int, size: tuple[int, int] | None, clock: Clock, seconds: float
) -> Iterator[NamedPicture]:
    """The pictures of a source.

    Args:
        source: as in `[camera] source`, but for rendered scenes.
        every: take each so many-th picture.
        size: width and height to ask of a live camera; of folders and videos what they must have.
        clock: ends live cameras.
        seconds: how long to listen to a live camera.

    Raises:
        ConfigError: a source that is not understood, does not exist, or is of a size that `[camera]` refuses.
        CameraError: a camera that does not answer.
        CalibrationError: pictures of different sizes.
    """
    if source.startswith("sim:"):
        raise ConfigError(f"{source}: a rendered camera needs no calibration, its field of view is exact")
    path = Path(source).expanduser()
    if path.is_dir():
        yield from _of_one_size(_from_folder(path, every), size)
    else:
        yield from _of_one_size(_from_camera(source, every, size, clock, seconds), size)


def _from_folder(folder: Path, every: int) -> Iterator[NamedPicture]:
    paths = sorted(
        (path for path in folder.iterdir() if path.suffix.lower() in PICTURE_SUFFIXES), key=natural_order
    )
    if not paths:
        raise ConfigError(f"{folder}: no pictures in it ({', '.join(sorted(PICTURE_SUFFIXES))})")
    for path in paths[::every]:
        # The file's orientation tag is not followed: no camera stream has one, and turning swaps fx and fy.
        image = cv2.imread(str(path), cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION)
        yield NamedPicture(path.name, None if image is None else np.asarray(image, np.uint8))


def _from_camera(
    source: str, every: int, size: tuple[int, int] | None, clock: Clock, seconds: float
) -> Iterator[NamedPicture]:
    live = is_live(source)
    width, height = size or (_video_size(source) if not live else (640, 480))
    _refuse_size(source, (width, height))
    settings = CameraSettings(
        source=source, width=width, height=height, horizontal_fov_deg=_DUMMY_FOV_DEG, realtime=live
    )
    camera = make_camera(source, settings, clock, _NoPose(), CameraMount())
    camera.open()
    end_ns = clock.now_ns() + round(seconds * 1e9)
    timeouts, number = 0, 0
    with contextlib.closing(camera):
        while not live or clock.now_ns() < end_ns:
            try:
                frame = camera.read(settings.read_timeout_s)
            except CameraEndedError:
                return
            except CameraTimeoutError:
                timeouts += 1
                if timeouts >= _TIMEOUTS_IN_A_ROW:
                    raise
                continue
            timeouts = 0
            if number % every == 0:
                yield NamedPicture(f"picture {number}", frame.image_bgr)
            number += 1


def _video_size(source: str) -> tuple[int, int]:
    capture = cv2.VideoCapture(str(Path(source).expanduser()), cv2.CAP_FFMPEG)
    try:
        whole, image = capture.read()
    finally:
        capture.release()
    if not whole:
        raise CameraError(f"{source}: not a video that can be read")
    return int(image.shape[1]), int(image.shape[0])


def _of_one_size(pictures: Iterator[NamedPicture], size: tuple[int, int] | None) -> Iterator[NamedPicture]:
    first = "--size"
    for picture in pictures:
        if picture.image_bgr is not None:
            own = (picture.image_bgr.shape[1], picture.image_bgr.shape[0])
            if size is None:
                _refuse_size(picture.name, own)
                size, first = own, picture.name
            if own != size:
                raise CalibrationError(
                    f"pictures of different sizes: {first} has {size[0]}x{size[1]}, {picture.name} has "
                    f"{own[0]}x{own[1]}; a calibration holds for one size only, the one that will fly"
                )
        yield picture


def _refuse_size(name: str, size: tuple[int, int]) -> None:
    low, high = _SIDES
    if not all(low <= side <= high for side in size):
        raise ConfigError(f"{name} has {size[0]}x{size[1]} pixels: [camera] takes {low} to {high} a side")


class _NoPose:
    """There is no vehicle: rendered cameras, which need one, were refused before."""

    def newest_pose(self) -> Telemetry:
        raise CameraError("there is no vehicle during a calibration")

    def telemetry_at(self, captured_ns: int) -> Telemetry:
        raise CameraError("there is no vehicle during a calibration")

    def predicted_pose(self, at_ns: int) -> Telemetry:
        raise CameraError("there is no vehicle during a calibration")
