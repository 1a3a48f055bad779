"""What costs nothing: answers that never look at the picture. A network must be far better."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from training.metrics import DEPTH_CAP_M
from uavdepth.attitude import Attitude
from uavdepth.camera import CameraModel, CameraMount
from uavdepth.model.hints import PointHints

TRAINING_MEDIAN_DEPTH_M = 12.1
"""Median depth nearer than 80 m of 480 of the training frames of the network that ships, 80 of each scene,
weighted as training draws them (`training.data.batches.SCENE_SHARES`)."""


def constant_depth(camera: CameraModel) -> NDArray[np.float32]:
    """(H, W) the median depth of the training frames everywhere."""
    return np.full((camera.height, camera.width), TRAINING_MEDIAN_DEPTH_M, np.float32)


def flat_ground_depth(
    camera: CameraModel, mount: CameraMount, attitude: Attitude, height_m: float
) -> NDArray[np.float32]:
    """(H, W) z-depth in metres if the world were a level plane and nothing else.

    Args:
        camera, mount: the camera and how it sits on the vehicle.
        attitude: of the vehicle.
        height_m: of the vehicle's origin above the ground, vertical.

    Returns:
        The plane's depth, at most `DEPTH_CAP_M`; that too above the horizon.
    """
    level_from_body = attitude.level_from_body
    level_from_camera = level_from_body @ mount.body_from_camera
    camera_height = max(height_m - float(level_from_body[2] @ mount.position_body_m), 0.0)
    down = camera.normalized_rays @ level_from_camera[2].astype(np.float32)
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = np.where(down > 0, np.float32(camera_height) / down, np.float32(DEPTH_CAP_M))
    return np.minimum(depth, np.float32(DEPTH_CAP_M)).astype(np.float32)


def nearest_point_depth(camera: CameraModel, points: PointHints) -> NDArray[np.float32]:
    """(H, W) z-depth in metres of the known point that is nearest in the picture, at every pixel.

    Without any point it is `constant_depth`.
    """
    limits = (camera.width - 1, camera.height - 1)
    column, row = np.clip(np.rint(points.pixels).astype(np.intp), 0, limits).T
    if not len(column):
        return constant_depth(camera)
    free = np.full((camera.height, camera.width), 255, np.uint8)
    free[row, column] = 0
    _, label = cv2.distanceTransformWithLabels(free, cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL)
    depth_of = np.empty(int(label.max()) + 1, np.float32)
    depth_of[label[row, column]] = points.depth_m
    return np.asarray(depth_of[label], np.float32)
