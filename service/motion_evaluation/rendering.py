"""Moments of a known motion through a rendered world."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from service.motion_evaluation.journey import Moment, Said
from uavdepth.attitude import Attitude
from uavdepth.camera import CameraModel, CameraMount
from uavdepth.model.hints import GroundHint
from uavdepth.scale.ground_scale import vertical_height_m
from uavdepth.scenes import Scene
from uavdepth.scenes.flight import Pose

HIGHEST_M = 40.0
"""Reach of the rangefinder."""

LOWEST_M = 0.3


class Autopilot(Protocol):
    """What says something of a motion."""

    def until(self, t_s: float) -> tuple[Said, ...]:
        """What it says from where it stopped up to `t_s`, in order of time."""

    def attitude(self, t_s: float) -> Attitude:
        """What it believes its attitude to be."""

    def range_m(self, true_m: float) -> float:
        """What its rangefinder says of a distance."""


def rendered_moments(
    scene: Scene,
    camera: CameraModel,
    mount: CameraMount,
    pose_at: Callable[[float], Pose],
    autopilot: Autopilot,
    times_s: NDArray[np.float64],
) -> Iterator[Moment]:
    """Pictures of a world from a known motion, at rising times."""
    for t_s in times_s.tolist():
        pose, said = pose_at(t_s), autopilot.until(t_s)
        picture = scene.render(camera, mount, pose.position_ned_m.tolist(), pose.attitude)
        yield Moment(
            round(t_s * 1e9),
            picture.image_bgr,
            picture.depth_m,
            said,
            _ground(scene, mount, pose, autopilot, t_s),
            float(np.linalg.norm(pose.velocity_ned_mps)),
        )


def _ground(
    scene: Scene, mount: CameraMount, pose: Pose, autopilot: Autopilot, t_s: float
) -> GroundHint | None:
    """What the rangefinder sees along the body's down axis: ground, a roof or a tree."""
    down = pose.attitude.ned_from_body @ np.array([0.0, 0.0, 1.0])
    reach_m = float(scene.ray_distance_m(pose.position_ned_m, down)[0])
    attitude = autopilot.attitude(t_s)
    height_m = vertical_height_m(autopilot.range_m(reach_m), attitude)
    return GroundHint(mount, attitude, height_m) if LOWEST_M <= height_m <= HIGHEST_M else None
