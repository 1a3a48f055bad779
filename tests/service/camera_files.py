"""Videos, folders and settings for the tests of cameras."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from program_fakes import HEIGHT, WIDTH, FakeLink, make_settings, picture

from service.cameras.source import make_camera
from service.clock import ManualClock, MonotonicClock
from service.settings.camera import CameraSettings
from uavdepth.camera import CameraMount

MOUNT = CameraMount()


def settings_for(source: Path | str, *overrides: str) -> CameraSettings:
    return make_settings(f"camera.source={source}", *overrides).camera


def camera_for(settings: CameraSettings, clock: ManualClock | MonotonicClock | None = None) -> Any:
    clock = clock or MonotonicClock()
    return make_camera(settings.source, settings, clock, FakeLink(clock), MOUNT)


def write_video(path: Path, shades: Sequence[int], fps: float = 20.0) -> Path:
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), fps, (WIDTH, HEIGHT))
    assert writer.isOpened()
    for shade in shades:
        writer.write(picture(shade))
    writer.release()
    return path


def write_folder(folder: Path, shades: Sequence[int]) -> Path:
    folder.mkdir()
    for number, shade in enumerate(shades):
        assert cv2.imwrite(str(folder / f"shot{number}.png"), picture(shade))
    return folder


def shade_of(image: NDArray[np.uint8]) -> int:
    return round(float(image.mean()))
