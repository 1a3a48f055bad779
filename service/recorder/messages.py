"""Our values as Foxglove's well-known messages, which Foxglove, Lichtblick and Rerun draw by themselves."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import cv2
import numpy as np
from foxglove.messages import (
    CameraCalibration,
    CompressedImage,
    FrameTransform,
    FrameTransforms,
    LaserScan,
    PackedElementField,
    PackedElementFieldNumericType,
    PointCloud,
    Pose,
    PoseInFrame,
    Quaternion,
    RawImage,
    Timestamp,
    Vector3,
)
from numpy.typing import NDArray

from service.errors import RecordError
from service.recorder.layout import BODY_FRAME, LEVEL_FRAME, LOCAL_FRAME, camera_frame
from service.recorder.sigma_codes import sigma_codes
from service.telemetry import Telemetry
from uavdepth.attitude import Attitude
from uavdepth.camera import CameraModel, CameraMount
from uavdepth.scan.obstacle_scan import ObstacleScan, SectorState

_FLIP = np.diag([1.0, -1.0, -1.0])
"""Between forward-right-down and the viewers' forward-left-up."""

_ENU_FROM_NED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
_FARTHEST_MM = 65_535
_POINT_BYTES = 12


def timestamp(wall_ns: int) -> Timestamp:
    """Nanoseconds since 1970 as the messages have them."""
    return Timestamp(wall_ns // 1_000_000_000, wall_ns % 1_000_000_000)


def compressed_image(
    image_bgr: NDArray[np.uint8], quality: int, wall_ns: int, camera: str = ""
) -> CompressedImage:
    """The picture as JPEG.

    Raises:
        RecordError: it cannot be encoded.
    """
    written, data = cv2.imencode(".jpg", image_bgr, [cv2.IMWRITE_JPEG_QUALITY, quality])
    if not written:
        raise RecordError(f"a picture of shape {image_bgr.shape} cannot be written as JPEG")
    return CompressedImage(
        timestamp=timestamp(wall_ns), frame_id=camera_frame(camera), data=data.tobytes(), format="jpeg"
    )


def depth_image(depth_m: NDArray[np.float32], wall_ns: int, camera: str = "") -> RawImage:
    """Depth as 16UC1 in whole millimetres, rounded down; 0 where it is unknown or beyond 65.535 m."""
    millimetres = np.floor(depth_m.astype(np.float64) * 1000.0)
    known = (millimetres >= 1) & (millimetres <= _FARTHEST_MM)  # NaN and infinity compare false
    packed = np.where(known, millimetres, 0).astype("<u2")
    return _raw_image(packed, "16UC1", wall_ns, camera)


def sigma_image(relative_sigma: NDArray[np.float32], wall_ns: int, camera: str = "") -> RawImage:
    """The uncertainty of depth as 8UC1 in the codes of `sigma_codes`."""
    return _raw_image(sigma_codes(relative_sigma), "8UC1", wall_ns, camera)


def _raw_image(pixels: NDArray[Any], encoding: str, wall_ns: int, camera: str) -> RawImage:
    height, width = pixels.shape
    return RawImage(
        timestamp=timestamp(wall_ns),
        frame_id=camera_frame(camera),
        width=width,
        height=height,
        encoding=encoding,
        step=pixels.itemsize * width,
        data=pixels.tobytes(),
    )


def calibration(camera: CameraModel, wall_ns: int, name: str = "") -> CameraCalibration:
    """The intrinsics and distortion of the camera `name`."""
    k = camera.matrix
    return CameraCalibration(
        timestamp=timestamp(wall_ns),
        frame_id=camera_frame(name),
        width=camera.width,
        height=camera.height,
        distortion_model="rational_polynomial" if len(camera.distortion) > 5 else "plumb_bob",
        D=list(camera.distortion or (0.0,) * 5),
        K=[float(value) for value in k.ravel()],
        R=[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        P=[float(value) for value in np.hstack([k, np.zeros((3, 1))]).ravel()],
    )


def laser_scan(scan: ObstacleScan, wall_ns: int) -> LaserScan:
    """The scan; angles are counterclockwise in the viewers. Clear is +inf, unknown NaN."""
    ranges = scan.distance_m.astype(np.float64)
    ranges[scan.state == SectorState.CLEAR] = np.inf
    ranges[scan.state == SectorState.UNKNOWN] = np.nan
    return LaserScan(
        timestamp=timestamp(wall_ns),
        frame_id=LEVEL_FRAME,
        start_angle=-math.radians(float(scan.bearing_deg[-1])),
        end_angle=-math.radians(float(scan.bearing_deg[0])),
        ranges=[float(value) for value in ranges[::-1]],
        intensities=[],
    )


def scan_points(scan: ObstacleScan, wall_ns: int) -> PointCloud:
    """The scan's obstacles as points: Rerun draws no laser scans."""
    found = scan.state == SectorState.OBSTACLE
    bearing, distance = np.radians(scan.bearing_deg[found]), scan.distance_m[found]
    points = np.stack([distance * np.cos(bearing), -distance * np.sin(bearing), 0 * distance], axis=1)
    number = PackedElementFieldNumericType.Float32
    return PointCloud(
        timestamp=timestamp(wall_ns),
        frame_id=LEVEL_FRAME,
        pose=_pose(np.zeros(3), np.eye(3)),
        point_stride=_POINT_BYTES,
        fields=[PackedElementField(name=n, offset=4 * i, type=number) for i, n in enumerate("xyz")],
        data=points.astype("<f4").tobytes(),
    )


def vehicle_pose(telemetry: Telemetry, wall_ns: int) -> PoseInFrame | None:
    """Where the vehicle is and how it lies, east-north-up; None without attitude."""
    if telemetry.attitude is None:
        return None
    rotation = _ENU_FROM_NED @ telemetry.attitude.ned_from_body @ _FLIP
    return PoseInFrame(
        timestamp=timestamp(wall_ns), frame_id=LOCAL_FRAME, pose=_pose(_place(telemetry), rotation)
    )


def frame_transforms(
    telemetry: Telemetry, mounts: Mapping[str, CameraMount], wall_ns: int
) -> FrameTransforms:
    """Local to level (heading), level to body (roll, pitch), body to each camera (mounts by name)."""
    attitude = telemetry.attitude or Attitude(0.0, 0.0, 0.0)
    heading = Attitude(0.0, 0.0, attitude.yaw_rad).ned_from_body
    steps = (
        (LOCAL_FRAME, LEVEL_FRAME, _place(telemetry), _ENU_FROM_NED @ heading @ _FLIP),
        (LEVEL_FRAME, BODY_FRAME, np.zeros(3), _FLIP @ attitude.level_from_body @ _FLIP),
        *(
            (BODY_FRAME, camera_frame(name), _FLIP @ mount.position_body_m, _FLIP @ mount.body_from_camera)
            for name, mount in mounts.items()
        ),
    )
    return FrameTransforms(
        transforms=[
            FrameTransform(
                timestamp=timestamp(wall_ns),
                parent_frame_id=parent,
                child_frame_id=child,
                translation=Vector3(x=float(place[0]), y=float(place[1]), z=float(place[2])),
                rotation=_quaternion(rotation),
            )
            for parent, child, place, rotation in steps
        ]
    )


def _place(telemetry: Telemetry) -> NDArray[np.float64]:
    position = telemetry.position_ned_m
    return np.zeros(3) if position is None else _ENU_FROM_NED @ np.array(position)


def _pose(place: NDArray[np.float64], rotation: NDArray[np.float64]) -> Pose:
    x, y, z = (float(value) for value in place)
    return Pose(position=Vector3(x=x, y=y, z=z), orientation=_quaternion(rotation))


def _quaternion(rotation: NDArray[np.float64]) -> Quaternion:
    """Of a (3, 3) rotation, by its rotation vector."""
    vector = cv2.Rodrigues(rotation)[0].ravel()
    angle = float(np.linalg.norm(vector))
    x, y, z = (float(v) for v in (vector / angle if angle > 0 else vector) * math.sin(angle / 2))
    return Quaternion(x=x, y=y, z=z, w=math.cos(angle / 2))
