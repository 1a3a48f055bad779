"""The demo's ground station: everything that the vehicle publishes, newest values kept."""

from __future__ import annotations

import threading
from contextlib import ExitStack
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from service.clock import Clock
from service.publisher import keys
from service.publisher.picture_receiver import PictureReceiver
from service.publisher.session import station_session
from service.publisher.status_wire import StatusSample
from service.publisher.wire import DepthHeader, ScanSample, WireError
from service.watch.board import Board, VehicleView
from service.watch.listener import Listener
from uavdepth.depth.codec import decode_depth_png
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


class GroundObserver:
    """Listens to scans and status as `uavdepth watch` does, and to one vehicle's pictures as the ground page.

    Pictures come over a session of their own, and what arrives is reported, so that the vehicle fits them to
    the link. They are decoded when they are looked at, not when they come.

    Args:
        vehicle: the vehicle's name.
        connect: its endpoint, `tcp/host:port`.
        clock: ages the samples.

    Raises:
        PublisherError: a session that cannot be opened.
    """

    def __init__(self, vehicle: str, connect: str, clock: Clock) -> None:
        self.board = Board()
        self._vehicle = vehicle
        self._clock = clock
        self._lock = threading.Lock()
        self._pictures = 0
        self._jpeg: bytes | None = None
        self._depth: tuple[bytes, bytes] | None = None
        with ExitStack() as stack:
            stack.enter_context(Listener([connect], self.board, clock))
            session = stack.enter_context(station_session((), (connect,)))
            stack.callback(PictureReceiver(session, vehicle, self._take_picture, clock).close)
            self._sessions = stack.pop_all()

    def close(self) -> None:
        """Close the sessions."""
        self._sessions.close()

    @property
    def samples(self) -> int:
        """Scans and pictures received so far."""
        view = self._view()
        with self._lock:
            return self._pictures + (0 if view is None else view.scans)

    @property
    def scan(self) -> ScanSample | None:
        """The newest scan, unless it is too old to show."""
        view = self._view()
        return None if view is None else view.scan

    @property
    def status(self) -> StatusSample | None:
        """The newest status, unless it is too old to show."""
        view = self._view()
        return None if view is None else view.status

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

    def _view(self) -> VehicleView | None:
        views = self.board.vehicles(self._clock.now_ns())
        return next((view for view in views if view.name == self._vehicle), None)

    def _take_picture(self, key: str, payload: bytes, attachment: bytes | None) -> None:
        with self._lock:
            self._pictures += 1
            if key.endswith(keys.CAMERA):
                self._jpeg = payload
            elif attachment is not None:
                self._depth = payload, attachment
