"""The demo's ground station: everything that the vehicle publishes, newest values kept."""

from __future__ import annotations

import threading
from dataclasses import dataclass

import cv2
import numpy as np
import zenoh
from numpy.typing import NDArray

from service.clock import Clock
from service.publisher import keys
from service.publisher.wire import DepthHeader, ScanSample, StatusSample, WireError
from service.watch.board import Board
from service.watch.listener import Listener
from uavdepth.depth_codec import decode_depth_png
from uavdepth.errors import DepthCodecError


@dataclass(frozen=True)
class Pictures:
    """The newest pictures of one vehicle.

    Args:
        image_bgr: (H, W, 3) uint8 camera picture.
        depth_m: (H, W) float32 depth in metres, NaN where unknown.
        header: what came with the depth.
    """

    image_bgr: NDArray[np.uint8]
    depth_m: NDArray[np.float32]
    header: DepthHeader


class GroundObserver(Listener):
    """Listens to scans and status as `uavdepth watch` does, and to one vehicle's pictures as well.

    Pictures are decoded when they are looked at, not when they come.

    Args:
        vehicle: the vehicle's name.
        connect: its endpoint, `tcp/host:port`.
        clock: ages the samples.

    Raises:
        PublisherError: the session cannot be opened.
    """

    def __init__(self, vehicle: str, connect: str, clock: Clock) -> None:
        self.board = Board()
        self._vehicle = vehicle
        self._own_clock = clock
        self._lock = threading.Lock()
        self._samples = 0
        self._jpeg: bytes | None = None
        self._depth: tuple[bytes, bytes] | None = None
        super().__init__([connect], self.board, clock)
        for topic in (keys.CAMERA, keys.DEPTH):
            self._session.declare_subscriber(keys.key(vehicle, topic), self._take_picture)

    @property
    def samples(self) -> int:
        """Samples received so far, on all keys."""
        with self._lock:
            return self._samples

    @property
    def scan(self) -> ScanSample | None:
        """The newest scan, unless it is too old to show."""
        views = [view for view in self.board.vehicles(self._own_clock.now_ns()) if view.name == self._vehicle]
        return views[0].scan if views else None

    @property
    def status(self) -> StatusSample | None:
        """The newest status, unless it is too old to show."""
        views = [view for view in self.board.vehicles(self._own_clock.now_ns()) if view.name == self._vehicle]
        return views[0].status if views else None

    def pictures(self) -> Pictures | None:
        """The newest camera and depth pictures, or None before both have come and where one is broken."""
        with self._lock:
            jpeg, depth = self._jpeg, self._depth
        if jpeg is None or depth is None:
            return None
        image = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR)
        if image is None:
            return None
        try:
            header = DepthHeader.decode(depth[1])
            depth_m = decode_depth_png(depth[0], header.near_m, header.far_m)
        except (WireError, DepthCodecError):
            return None
        return Pictures(np.asarray(image, np.uint8), depth_m, header)

    def _hear(self, sample: zenoh.Sample) -> None:
        with self._lock:
            self._samples += 1
        super()._hear(sample)

    def _take_picture(self, sample: zenoh.Sample) -> None:
        with self._lock:
            self._samples += 1
            if str(sample.key_expr).endswith(keys.CAMERA):
                self._jpeg = sample.payload.to_bytes()
            elif sample.attachment is not None:
                self._depth = sample.payload.to_bytes(), sample.attachment.to_bytes()
