"""`[camera]`: where pictures come from and how the lens maps the world onto them."""

from __future__ import annotations

from typing import Self

from pydantic import Field, model_validator

from service.settings.section import Section
from uavdepth.camera import CameraModel

SIM_DEFAULT_FOV_DEG = 90.0
"""Field of view of the rendered camera when the configuration names none: it has no lens to calibrate."""

_CALIBRATION_KEYS = ("fx", "fy", "cx", "cy")


class CameraSettings(Section):
    """Where pictures come from and how the lens maps the world onto them."""

    source: str = Field(
        min_length=1,
        title="Camera source",
        description='`"0"` (number of a USB/V4L2 camera, or a path such as `"/dev/video0"`), '
        "path of a video file, path of a folder of pictures, "
        '`"rtsp://..."`, or `"sim:SCENE[:SEED]"`, a rendered world seen from the pose that the autopilot '
        "reports (`mountain`, `city`, `wall`, `forest`, `park`, `suburb`, `farm`, `works`).",
    )
    width: int = Field(
        default=640,
        ge=64,
        le=4096,
        title="Picture width, pixels",
        description="Width of the calibrated picture; asked of USB cameras, demanded of all others.",
    )
    height: int = Field(
        default=480,
        ge=64,
        le=4096,
        title="Picture height, pixels",
        description="Height of the calibrated picture; asked of USB cameras, demanded of all others.",
    )
    fps: float = Field(
        default=30.0,
        ge=1.0,
        le=240.0,
        title="Pictures per second",
        description="Asked of USB cameras; the pace of image folders, rendered scenes and of video files "
        "that do not say theirs.",
    )
    fx: float | None = Field(
        default=None, gt=0.0, title="Focal length x, pixels", description="From the camera's calibration."
    )
    fy: float | None = Field(
        default=None, gt=0.0, title="Focal length y, pixels", description="From the camera's calibration."
    )
    cx: float | None = Field(
        default=None,
        title="Principal point x, pixels",
        description="From the camera's calibration; the centre of the first pixel is 0.",
    )
    cy: float | None = Field(
        default=None,
        title="Principal point y, pixels",
        description="From the camera's calibration; the centre of the first pixel is 0.",
    )
    distortion: tuple[float, ...] = Field(
        default=(),
        strict=False,
        title="Lens distortion",
        description="OpenCV's pinhole coefficients k1, k2, p1, p2[, k3[, k4, k5, k6 ...]]; empty: none.",
    )
    horizontal_fov_deg: float | None = Field(
        default=None,
        ge=10.0,
        le=150.0,
        title="Horizontal field of view, degrees",
        description="Instead of fx, fy, cx, cy: angle between the picture's left and right edge. "
        f"Rendered scenes take {SIM_DEFAULT_FOV_DEG:g} where neither is given.",
    )
    resize_pictures: bool = Field(
        default=False,
        title="Accept other sizes of the same aspect",
        description="Resize pictures whose size is not width x height but whose aspect is the same. "
        "Otherwise such a camera is refused, because its calibration would be wrong.",
    )
    mask: str | None = Field(
        default=None,
        min_length=1,
        title="Mask picture",
        description="Path of a picture of width x height, white where the camera may look and black where it "
        "sees the vehicle itself (landing legs, propellers): what is black is unknown, never near.",
    )
    latency_ms: float = Field(
        default=0.0,
        ge=0.0,
        le=1000.0,
        title="Exposure to delivery, milliseconds",
        description="Constant delay between exposure and delivery, taken off each capture stamp. "
        "Wrong values turn the scan by yaw rate times the error.",
    )
    loop: bool = Field(
        default=False,
        title="Repeat files",
        description="Start a video file or image folder again at its end; otherwise the service ends there.",
    )
    realtime: bool = Field(
        default=True,
        title="Play files at their own pace",
        description="Off: a video file or image folder is read as fast as it can be.",
    )
    open_timeout_s: float = Field(
        default=5.0,
        ge=0.1,
        le=60.0,
        title="Time to open, seconds",
        description="A network camera that does not answer within it is given up and tried again.",
    )
    read_timeout_s: float = Field(
        default=2.0,
        ge=0.1,
        le=60.0,
        title="Time without a picture, seconds",
        description="A camera that delivers nothing for so long is closed and opened again.",
    )
    reopen_after_s: float = Field(
        default=0.5,
        ge=0.05,
        le=30.0,
        title="First pause before reopening, seconds",
        description="Doubles with each failure in a row, up to `reopen_at_most_s`.",
    )
    reopen_at_most_s: float = Field(
        default=5.0,
        ge=0.05,
        le=60.0,
        title="Longest pause before reopening, seconds",
        description="A lost camera is tried again at least this often, for as long as the service runs.",
    )

    @property
    def is_sim(self) -> bool:
        """Whether the pictures are rendered."""
        return self.source.startswith("sim:")

    @property
    def model(self) -> CameraModel:
        """The camera that width, height and calibration describe."""
        if self.fx is not None and self.fy is not None and self.cx is not None and self.cy is not None:
            return CameraModel(
                self.width, self.height, self.fx, self.fy, self.cx, self.cy, tuple(self.distortion)
            )
        fov_deg = SIM_DEFAULT_FOV_DEG if self.horizontal_fov_deg is None else self.horizontal_fov_deg
        square = CameraModel.from_fov(self.width, self.height, fov_deg)
        return CameraModel(
            self.width, self.height, square.fx, square.fy, square.cx, square.cy, tuple(self.distortion)
        )

    @model_validator(mode="after")
    def _has_one_calibration(self) -> Self:
        given = [key for key in _CALIBRATION_KEYS if getattr(self, key) is not None]
        if given and self.horizontal_fov_deg is not None:
            raise ValueError(f"{given[0]} and horizontal_fov_deg are both given: keep one of the two")
        if given and len(given) < len(_CALIBRATION_KEYS):
            missing = [key for key in _CALIBRATION_KEYS if key not in given]
            raise ValueError(f"{', '.join(missing)} missing: fx, fy, cx and cy belong together")
        if not given and self.horizontal_fov_deg is None and not self.is_sim:
            raise ValueError(
                "no calibration: give fx, fy, cx, cy or horizontal_fov_deg, metres cannot be told without"
            )
        if self.reopen_at_most_s < self.reopen_after_s:
            raise ValueError(
                f"reopen_at_most_s: {self.reopen_at_most_s:g} is below reopen_after_s {self.reopen_after_s:g}"
            )
        _ = self.model  # a CameraModelError is a ValueError: a wrong distortion is refused here
        return self
