"""What a rendered picture costs, in processor time of one core."""

from __future__ import annotations

import time

from service.benchmark.pictures import MOUNT, SEED
from uavdepth.camera import CameraModel
from uavdepth.scenes import SCENE_NAMES, load_scene

CAMERA = CameraModel.from_fov(384, 192, 90.0)
_POSES = 8
_SECONDS = 10.0


def measure_rendering() -> dict[str, float]:
    """Mean milliseconds of processor time for a picture of 384x192 along a flight, by scene."""
    means = {}
    for name in SCENE_NAMES:
        scene = load_scene(name, SEED)
        flight = scene.flight(0, _SECONDS)
        poses = [flight.at(_SECONDS * number / _POSES) for number in range(_POSES)]
        # The first picture loads the compiled shading.
        scene.render(CAMERA, MOUNT, poses[0].position_ned_m.tolist(), poses[0].attitude)
        begun_ns = time.thread_time_ns()
        for pose in poses:
            scene.render(CAMERA, MOUNT, pose.position_ned_m.tolist(), pose.attitude)
        means[name] = round((time.thread_time_ns() - begun_ns) / 1e6 / _POSES, 1)
    return means
