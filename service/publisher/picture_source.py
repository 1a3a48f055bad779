"""From one measured picture to what is sent of it: depth, video or camera, as large as allowed."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from service.pipeline import PerceptionResult
from service.publisher import keys
from service.publisher.budget import PictureBudget
from service.publisher.depth_picture import shrunk_camera, shrunk_codes
from service.publisher.picture_size import FRAME_S, Ladder, camera_ladder, depth_ladder
from service.publisher.video import VideoEncoder, VideoHeader
from service.publisher.wire import CameraHeader, DepthHeader, Intrinsics, Stamp
from service.settings.zenoh import ZenohSettings
from uavdepth.depth.codec import depth_codes, encode_codes_png

_VIDEO_SHARE = 0.5
_MAX_VIDEO_BYTES_PER_S = 50_000.0
_VIDEO_SIDE = 640
"""A wider depth picture is halved: thin is for links on which nobody sees the difference."""


@dataclass(frozen=True)
class Sendable:
    """A picture on its way: payload, what comes with it, and whether it is small enough."""

    payload: bytes
    header: Stamp
    fits: bool


class PictureSource:
    """Makes the pictures of one vehicle, each as large as the budget allows.

    Args:
        settings: `[zenoh]`.
        camera: whose pixels the pictures have.
    """

    def __init__(self, settings: ZenohSettings, camera: Intrinsics) -> None:
        self._settings = settings
        self._camera = camera
        self._ladders = {
            keys.DEPTH: Ladder(depth_ladder()),
            keys.CAMERA: Ladder(camera_ladder(settings.camera_quality)),
        }
        self._video: VideoEncoder | None = None
        self.wants_key_frame = False
        """A viewer cannot read the video before the next key frame."""

    def wants_more(self, topic: str) -> bool:
        """Whether pictures of `topic` are smaller than they could be."""
        ladder = self._ladders.get(topic)
        return ladder is not None and not ladder.is_at_top

    def make(
        self, topic: str, result: PerceptionResult, now_ns: int, budget: PictureBudget
    ) -> Sendable | None:
        """The picture of `topic`, or None where `result` has none.

        Raises:
            DepthCodecError: depth that cannot be encoded.
        """
        stamp = Stamp(
            index=result.frame.index,
            captured_ns=result.captured_ns,
            age_ms=max(0.0, (now_ns - result.captured_ns) / 1e6),
        )
        allowed = budget.bytes_per_s * FRAME_S
        if topic == keys.CAMERA:
            return self._jpeg(result.frame.image_bgr, stamp, allowed, now_ns)
        if result.depth is None:
            return None
        settings = self._settings
        codes = depth_codes(result.depth.believed_m, settings.depth_near_m, settings.depth_far_m)
        if topic == keys.VIDEO:
            return self._h264(codes, stamp, budget.bytes_per_s, now_ns)
        divisor = self._ladders[topic].step.divisor
        payload = encode_codes_png(shrunk_codes(codes, divisor))
        header = DepthHeader(
            **stamp.model_dump(),
            near_m=settings.depth_near_m,
            far_m=settings.depth_far_m,
            camera=shrunk_camera(self._camera, divisor),
            scale_factor=None if result.scale is None else result.scale.factor,
            scale_relative_sigma=None if result.scale is None else result.scale.relative_sigma,
        )
        return Sendable(payload, header, self._ladders[topic].written(len(payload), allowed, now_ns))

    def _jpeg(
        self, image_bgr: NDArray[np.uint8], stamp: Stamp, allowed: float, now_ns: int
    ) -> Sendable | None:
        step = self._ladders[keys.CAMERA].step
        camera = shrunk_camera(self._camera, step.divisor)
        if step.divisor > 1:
            size = (camera.width, camera.height)
            image_bgr = np.asarray(cv2.resize(image_bgr, size, interpolation=cv2.INTER_AREA), np.uint8)
        written, data = cv2.imencode(".jpg", image_bgr, [cv2.IMWRITE_JPEG_QUALITY, step.quality])
        if not written:
            return None
        payload = data.tobytes()
        header = CameraHeader(**stamp.model_dump(), camera=camera)
        return Sendable(payload, header, self._ladders[keys.CAMERA].written(len(payload), allowed, now_ns))

    def _h264(self, codes: NDArray[np.uint8], stamp: Stamp, bytes_per_s: float, now_ns: int) -> Sendable:
        divisor = -(-codes.shape[1] // _VIDEO_SIDE)
        codes, camera = shrunk_codes(codes, divisor), shrunk_camera(self._camera, divisor)
        if self._video is None:
            self._video = VideoEncoder(codes.shape[1], codes.shape[0], self._settings.depth_rate_hz)
        rate = min(_VIDEO_SHARE * bytes_per_s, _MAX_VIDEO_BYTES_PER_S)
        payload, is_key = self._video.encode(codes, now_ns, rate, key_frame=self.wants_key_frame)
        self.wants_key_frame = False
        header = VideoHeader(
            **stamp.model_dump(),
            stream=str(self._video.stream),
            sequence=self._video.sequence,
            is_key=is_key,
            near_m=self._settings.depth_near_m,
            far_m=self._settings.depth_far_m,
            camera=camera,
        )
        return Sendable(payload, header, fits=True)
