"""Monocular obstacle awareness for drones: the perception library.

    from uavdepth import Attitude, CameraModel, CameraMount, DepthModel, ObstacleScanner

    camera = CameraModel.from_fov(640, 320, 90)
    depth = DepthModel.load().infer(image_bgr, camera)
    scan = ObstacleScanner(camera, CameraMount()).scan(depth.depth_m, Attitude(0, 0, 0), height_m=3)
    message = encode_obstacle_distance(scan)

Importing it is light: ONNX Runtime and pymavlink load when a network is loaded or a message is made.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from uavdepth.attitude import Attitude
from uavdepth.camera import CameraModel, CameraMount
from uavdepth.depth.codec import decode_depth_png, encode_depth_png
from uavdepth.depth.colors import colorize_depth
from uavdepth.depth.depth_map import DepthMap
from uavdepth.depth.picture import DepthPictureInfo
from uavdepth.errors import (
    CameraModelError,
    DepthCodecError,
    HintError,
    ImageSizeError,
    ModelCardError,
    ModelFileError,
    ScanError,
    SceneError,
    UavDepthError,
)
from uavdepth.messages.obstacle_distance import encode_obstacle_distance, obstacle_words
from uavdepth.model.hints import GroundHint, Hints, PointHints
from uavdepth.motion.motion_point_settings import MotionPointSettings
from uavdepth.motion.motion_points import MotionPoints
from uavdepth.motion.vehicle_motion import MotionNoise, VehicleMotion
from uavdepth.scale.estimator import ScaleEstimate, ScaleEstimator
from uavdepth.scale.ground_scale import GroundScale, GroundScaler, vertical_height_m
from uavdepth.scan.image_mask import load_image_mask
from uavdepth.scan.memory import ScanMemory
from uavdepth.scan.merge import merge_scans
from uavdepth.scan.motion import PlanarPose, moved_scan
from uavdepth.scan.obstacle_scan import ObstacleScan, SectorState
from uavdepth.scan.scanner import ObstacleScanner

if TYPE_CHECKING:
    from uavdepth.model.card import ModelCard
    from uavdepth.model.depth_model import DepthModel

__all__ = [
    "Attitude",
    "CameraModel",
    "CameraModelError",
    "CameraMount",
    "DepthCodecError",
    "DepthMap",
    "DepthModel",
    "DepthPictureInfo",
    "GroundHint",
    "GroundScale",
    "GroundScaler",
    "HintError",
    "Hints",
    "ImageSizeError",
    "ModelCard",
    "ModelCardError",
    "ModelFileError",
    "MotionNoise",
    "MotionPointSettings",
    "MotionPoints",
    "ObstacleScan",
    "ObstacleScanner",
    "PlanarPose",
    "PointHints",
    "ScaleEstimate",
    "ScaleEstimator",
    "ScanError",
    "ScanMemory",
    "SceneError",
    "SectorState",
    "UavDepthError",
    "VehicleMotion",
    "colorize_depth",
    "decode_depth_png",
    "encode_depth_png",
    "encode_obstacle_distance",
    "load_image_mask",
    "merge_scans",
    "moved_scan",
    "obstacle_words",
    "vertical_height_m",
]


def __getattr__(name: str) -> Any:
    """Names whose modules are heavy (pydantic) are imported when they are first asked for."""
    if name == "DepthModel":
        from uavdepth.model.depth_model import DepthModel

        return DepthModel
    if name == "ModelCard":
        from uavdepth.model.card import ModelCard

        return ModelCard
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
