"""What must travel with an encoded depth picture so that a reader can turn it into points."""

from __future__ import annotations

from dataclasses import dataclass

from uavdepth.camera import CameraModel

DEPTH_PICTURE_VERSION = 1
"""Goes up when the meaning of a code or of a field changes."""

LOG_DEPTH_ENCODING = "log8-png"
"""`uavdepth.depth.codec`: 0 invalid, 1 nearer than near_m, 2 to 254 logarithmic, 255 far_m or beyond."""


@dataclass(frozen=True)
class DepthPictureInfo:
    """Metadata of one log-depth PNG; every value is plain, so it can be written as JSON.

    Args:
        near_m, far_m: span of the codec's levels in metres.
        width, height: size of the picture in pixels.
        fx, fy, cx, cy: intrinsics in its pixels; the centre of the first pixel is (0, 0).
        distortion: OpenCV's distortion numbers, or empty.
        version: `DEPTH_PICTURE_VERSION`.
        encoding: `LOG_DEPTH_ENCODING`.
    """

    near_m: float
    far_m: float
    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    distortion: tuple[float, ...] = ()
    version: int = DEPTH_PICTURE_VERSION
    encoding: str = LOG_DEPTH_ENCODING

    @classmethod
    def of(cls, camera: CameraModel, near_m: float, far_m: float) -> DepthPictureInfo:
        """The information for a picture in the pixels of `camera`."""
        return cls(
            near_m,
            far_m,
            camera.width,
            camera.height,
            camera.fx,
            camera.fy,
            camera.cx,
            camera.cy,
            camera.distortion,
        )

    @property
    def camera(self) -> CameraModel:
        """The camera whose pixels the picture has."""
        return CameraModel(self.width, self.height, self.fx, self.fy, self.cx, self.cy, self.distortion)
