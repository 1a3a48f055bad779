"""The camera: where its pixels look, and where it sits on the vehicle."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from uavdepth.errors import CameraModelError
from uavdepth.rotation import rotation_zyx

_DISTORTION_LENGTHS = (0, 4, 5, 8, 12, 14)
"""Lengths of the distortion vector that OpenCV's pinhole model knows."""

BODY_FROM_CAMERA_AXES = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""Camera axes (x right, y down, z forward) in an unrotated mount's FRD axes."""


@dataclass(frozen=True)
class CameraModel:
    """Pinhole camera with OpenCV distortion.

    Args:
        width, height: image size in pixels.
        fx, fy: focal lengths in pixels.
        cx, cy: principal point in pixels; the centre of the first pixel is (0, 0), as in OpenCV.
        distortion: OpenCV's (k1, k2, p1, p2[, k3[, k4, k5, k6[, s1, s2, s3, s4[, tx, ty]]]]), or empty.

    Raises:
        CameraModelError: a size or focal length that is not positive and finite, a principal point
            that is not finite, or a distortion vector of a length that OpenCV does not have.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    distortion: tuple[float, ...] = field(default=())

    def __post_init__(self) -> None:
        for name in ("width", "height"):
            value = getattr(self, name)
            if value != int(value) or not 1 <= value <= 16384:
                raise CameraModelError(f"{name} is {value}: a whole number from 1 to 16384 is needed")
        for name in ("fx", "fy"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0):
                raise CameraModelError(f"{name} is {value}: a finite focal length above 0 pixels is needed")
        for name in ("cx", "cy"):
            if not math.isfinite(getattr(self, name)):
                raise CameraModelError(
                    f"{name} is {getattr(self, name)}: a finite number of pixels is needed"
                )
        if len(self.distortion) not in _DISTORTION_LENGTHS:
            raise CameraModelError(
                f"distortion has {len(self.distortion)} numbers: OpenCV's model has {_DISTORTION_LENGTHS}"
            )
        if not all(math.isfinite(value) for value in self.distortion):
            raise CameraModelError(f"distortion is {self.distortion}: finite numbers are needed")
        object.__setattr__(self, "distortion", tuple(float(value) for value in self.distortion))

    @classmethod
    def from_fov(cls, width: int, height: int, horizontal_fov_deg: float) -> CameraModel:
        """Undistorted camera with square pixels and the principal point in the middle.

        Args:
            width, height: image size in pixels.
            horizontal_fov_deg: angle between the image's left and right edges, 1 to 170 degrees.
        """
        if not 1.0 <= horizontal_fov_deg <= 170.0:
            raise CameraModelError(
                f"horizontal field of view is {horizontal_fov_deg} deg: 1 to 170 is needed"
            )
        focal = 0.5 * width / math.tan(math.radians(horizontal_fov_deg) / 2)
        return cls(width, height, focal, focal, (width - 1) / 2, (height - 1) / 2)

    def scaled(self, width: int, height: int) -> CameraModel:
        """The same camera with its image resized to `width` x `height` (aspect may change)."""
        sx, sy = width / self.width, height / self.height
        return CameraModel(
            width,
            height,
            self.fx * sx,
            self.fy * sy,
            (self.cx + 0.5) * sx - 0.5,
            (self.cy + 0.5) * sy - 0.5,
            self.distortion,
        )

    @property
    def matrix(self) -> NDArray[np.float64]:
        """Intrinsics K, (3, 3)."""
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])

    def straightened(self, pixels: NDArray[np.floating]) -> NDArray[np.float64]:
        """(N, 2) normalised x, y (times z-depth they are the point's) of (N, 2) pixels anywhere."""
        flat = np.asarray(pixels, dtype=np.float64).reshape(-1, 2)
        if any(self.distortion) and len(flat):
            return _undistorted(flat.reshape(-1, 1, 2), self).reshape(-1, 2)
        return (flat - (self.cx, self.cy)) / (self.fx, self.fy)

    def projected(self, points: NDArray[np.floating]) -> NDArray[np.float64]:
        """(N, 2) pixels of (N, 3) points in camera axes; NaN for those that are not in front."""
        flat = np.asarray(points, dtype=np.float64).reshape(-1, 3)
        pixels = np.full((len(flat), 2), np.nan)
        front = flat[:, 2] > 1e-6
        if not front.any():
            return pixels
        if any(self.distortion):
            seen, _ = cv2.projectPoints(
                flat[front], np.zeros(3), np.zeros(3), self.matrix, np.array(self.distortion)
            )
            pixels[front] = seen.reshape(-1, 2)
        else:
            pixels[front] = flat[front, :2] / flat[front, 2:] * (self.fx, self.fy) + (self.cx, self.cy)
        return pixels

    @cached_property
    def normalized_rays(self) -> NDArray[np.float32]:
        """(H, W, 3) float32 direction of each pixel centre with z = 1: times z-depth it is the point."""
        u, v = np.meshgrid(np.arange(self.width, dtype=np.float64), np.arange(self.height, dtype=np.float64))
        if any(self.distortion):
            flat = _undistorted(np.stack([u, v], axis=-1).reshape(-1, 1, 2), self)
            xy = flat.reshape(self.height, self.width, 2)
        else:
            xy = np.stack([(u - self.cx) / self.fx, (v - self.cy) / self.fy], axis=-1)
        rays = np.concatenate([xy, np.ones((self.height, self.width, 1))], axis=-1).astype(np.float32)
        rays.flags.writeable = False
        return rays

    @cached_property
    def rays(self) -> NDArray[np.float32]:
        """(H, W, 3) float32 unit vectors of each pixel centre, camera frame (x right, y down, z forward)."""
        directions = self.normalized_rays
        unit = directions / np.linalg.norm(directions, axis=-1, keepdims=True)
        unit.flags.writeable = False
        return unit  # type: ignore[no-any-return]


@dataclass(frozen=True)
class CameraMount:
    """The camera in the body frame (FRD: x forward, y right, z down).

    Args:
        roll_deg, pitch_deg, yaw_deg: rotation of the camera from looking straight ahead, applied as
            yaw, pitch, roll like an attitude; pitch_deg < 0 looks down, yaw_deg > 0 looks right.
        forward_m, right_m, down_m: position of the camera from the vehicle's origin.
    """

    roll_deg: float = 0.0
    pitch_deg: float = 0.0
    yaw_deg: float = 0.0
    forward_m: float = 0.0
    right_m: float = 0.0
    down_m: float = 0.0

    def __post_init__(self) -> None:
        for name in ("roll_deg", "pitch_deg", "yaw_deg", "forward_m", "right_m", "down_m"):
            if not math.isfinite(getattr(self, name)):
                raise CameraModelError(f"mount {name} is {getattr(self, name)}: a finite number is needed")

    @property
    def body_from_camera(self) -> NDArray[np.float64]:
        """(3, 3) rotation that takes camera-frame vectors into body FRD."""
        roll, pitch, yaw = (math.radians(angle) for angle in (self.roll_deg, self.pitch_deg, self.yaw_deg))
        return np.asarray(rotation_zyx(roll, pitch, yaw) @ BODY_FROM_CAMERA_AXES, dtype=np.float64)

    @property
    def position_body_m(self) -> NDArray[np.float64]:
        """(3,) camera position in body FRD, metres."""
        return np.array([self.forward_m, self.right_m, self.down_m])


def _undistorted(pixels: NDArray[np.float64], camera: CameraModel) -> NDArray[np.float64]:
    """(N, 1, 2) normalised x, y of (N, 1, 2) pixels of a distorted camera."""
    criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 40, 1e-9)
    distortion = np.array(camera.distortion)
    # OpenCV 4 iterates to a criterion in a function of its own; OpenCV 5 folded it into undistortPoints.
    iterated = getattr(cv2, "undistortPointsIter", None)
    if iterated is not None:
        flat = iterated(pixels, camera.matrix, distortion, np.eye(3), np.eye(3), criteria)
    else:
        flat = cv2.undistortPoints(
            pixels, camera.matrix, distortion, R=np.eye(3), P=np.eye(3), criteria=criteria
        )
    return np.asarray(flat, dtype=np.float64)
