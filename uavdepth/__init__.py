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
from uavdepth.depth_codec import decode_depth_png, encode_depth_png
from uavdepth.depth_colors import colorize_depth
from uavdepth.depth_map import DepthMap
from uavdepth.depth_picture import DepthPictureInfo
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
from uavdepth.ground_scale import GroundScale, GroundScaler, vertical_height_m
from uavdepth.hints import GroundHint, Hints, PointHints
from uavdepth.image_mask import load_image_mask
from uavdepth.motion_points import MotionPoints, MotionPointSettings
from uavdepth.obstacle_message import encode_obstacle_distance, obstacle_words
from uavdepth.obstacle_scan import ObstacleScan, SectorState
from uavdepth.scale_estimator import ScaleEstimate, ScaleEstimator
from uavdepth.scan_memory import ScanMemory
from uavdepth.scan_merge import merge_scans
from uavdepth.scan_motion import PlanarPose, moved_scan
from uavdepth.scanner import ObstacleScanner
from uavdepth.vehicle_motion import MotionNoise, VehicleMotion

if TYPE_CHECKING:
    from uavdepth.depth_model import DepthModel
    from uavdepth.model_card import ModelCard

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
        from uavdepth.depth_model import DepthModel

        return DepthModel
    if name == "ModelCard":
        from uavdepth.model_card import ModelCard

        return ModelCard
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
