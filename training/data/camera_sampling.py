"""Random cameras, as drones carry them."""

from __future__ import annotations

import math

import numpy as np

from uavdepth.camera import CameraModel, CameraMount

FIELD_OF_VIEW_DEG = (60.0, 110.0)
FOCAL_RATIO = (0.65, 1.05)
"""fy / fx in the network's 2:1 picture: 0.67 for a stretched 4:3 camera, 0.89 for 16:9, 1 for 2:1."""
MOUNT_PITCH_DEG = (-30.0, 5.0)
_LEVEL_MOUNT_SHARE = 0.4
_PRINCIPAL_POINT_SPREAD = 0.02


def sample_camera(rng: np.random.Generator, width: int, height: int) -> CameraModel:
    """A camera whose picture fills the network's frame, fields of view and aspect drawn evenly."""
    half_angle = math.radians(rng.uniform(*FIELD_OF_VIEW_DEG)) / 2
    fx = 0.5 * width / math.tan(half_angle)
    fy = fx * rng.uniform(*FOCAL_RATIO)
    cx = (width - 1) / 2 + rng.normal(0.0, _PRINCIPAL_POINT_SPREAD) * width
    cy = (height - 1) / 2 + rng.normal(0.0, _PRINCIPAL_POINT_SPREAD) * height
    return CameraModel(width, height, fx, fy, cx, cy)


def sample_mount(rng: np.random.Generator) -> CameraMount:
    """Two in five look straight ahead, the others are tilted."""
    if rng.random() < _LEVEL_MOUNT_SHARE:
        return CameraMount(pitch_deg=rng.normal(0.0, 1.5))
    return CameraMount(pitch_deg=rng.uniform(*MOUNT_PITCH_DEG), roll_deg=rng.normal(0.0, 1.0))
