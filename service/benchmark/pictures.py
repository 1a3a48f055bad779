"""The pictures that the benchmark measures with: a rendered street from a vehicle that flies along it."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from uavdepth.attitude import Attitude
from uavdepth.camera import CameraModel, CameraMount
from uavdepth.scenes import load_scene

SCENE, SEED = "city", 1003
HEIGHT_M = 3.0
CAMERA = CameraModel.from_fov(640, 320, 90.0)
MOUNT = CameraMount(pitch_deg=-10.0)
LEVEL = Attitude(0.0, 0.0, 0.0)
SPEED_MPS, FPS = 3.0, 15.0


def render_pictures(count: int) -> list[NDArray[np.uint8]]:
    """`count` pictures of (320, 640, 3) uint8 BGR at `FPS`, on the way to the facade that ends the street."""
    scene = load_scene(SCENE, SEED)
    return [
        scene.render(CAMERA, MOUNT, (SPEED_MPS * number / FPS, 0.0, -HEIGHT_M), LEVEL).image_bgr
        for number in range(count)
    ]


def write_pictures(pictures: list[NDArray[np.uint8]], folder: Path) -> None:
    """Write pictures as an image folder that the service can read."""
    for number, picture in enumerate(pictures):
        (folder / f"{number:04d}.jpg").write_bytes(cv2.imencode(".jpg", picture)[1].tobytes())
