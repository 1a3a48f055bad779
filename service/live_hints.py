"""Points measured by the vehicle's own motion, picture by picture."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

import numpy as np
import structlog

from service.frame import Frame
from service.settings.motion import MotionSettings
from service.telemetry import Telemetry
from uavdepth.camera import CameraModel, CameraMount
from uavdepth.model.hints import PointHints
from uavdepth.motion.motion_point_settings import MotionPointSettings
from uavdepth.motion.motion_points import MotionPoints
from uavdepth.motion.vehicle_motion import VehicleMotion

log = structlog.get_logger()

_SAMPLE_NS = 40_000_000
"""Motion is looked up so often between two pictures, so that slow pictures leave no gap in it."""

_LONGEST_LOOK_BACK_NS = 500_000_000
_FEWEST_POINTS = 10
"""Fewer may all lie on one thing that moves."""

Result = TypeVar("Result")


class LiveHints:
    """Follows the pictures of one camera and the vehicle's motion; never raises.

    Args:
        camera, mount: the camera and how it sits on the vehicle.
        settings: the `[motion]` section.
    """

    def __init__(self, camera: CameraModel, mount: CameraMount, settings: MotionSettings) -> None:
        measured = MotionPointSettings(edges=settings.edges)
        self._points = MotionPoints(camera, mount, measured) if settings.points else None
        self._motion = VehicleMotion(settings.noise)
        self._attitude_ns: int | None = None
        self._position_ns: int | None = None
        self._epoch: int | None = None
        self._complained = False

    @property
    def suspicion(self) -> str | None:
        """What turns in flight show to be wrong with the focal length, in words, or None."""
        return None if self._points is None else self._points.suspicion

    @property
    def scale_sigma(self) -> float:
        """What the last points leave uncertain of the scale of a picture; infinite where there are too few.

        Most of their error is one that they share, that of the velocity: more points do not make it smaller.
        Those of edges have one of their own besides, and no say in it.
        """
        if self._points is None or len(self._points.corners) < _FEWEST_POINTS:
            return float("inf")
        return float(np.median(self._points.corners.relative_sigma))

    def clear(self) -> None:
        """Forget all points and the motion."""
        self._motion.clear()
        self._attitude_ns = self._position_ns = None
        if self._points is not None:
            self._points.clear()

    def update(self, frame: Frame, telemetry_at: Callable[[int], Telemetry]) -> PointHints | None:
        """The points of a picture, or None where nothing is measured.

        Args:
            frame: the picture, not older than the one before; an older one begins anew.
            telemetry_at: the vehicle at a time; an answer for another time is not listened to.
        """
        points = self._guarded(lambda following: self._followed(following, frame, telemetry_at))
        return points if points is not None and len(points) else None

    def measure(self) -> None:
        """What only later pictures need; `update` begins with it where nobody called."""
        self._guarded(MotionPoints.measure)

    def _guarded(self, work: Callable[[MotionPoints], Result]) -> Result | None:
        if self._points is None:
            return None
        try:
            return work(self._points)
        except Exception:
            # Points are a help: without them the height still tells metres, or nothing does and that is said.
            if not self._complained:
                self._complained = True
                log.exception("measuring points by motion failed")
            self.clear()
            return None

    def _followed(
        self, points: MotionPoints, frame: Frame, telemetry_at: Callable[[int], Telemetry]
    ) -> PointHints:
        points.measure()
        self._hear(frame.captured_ns, telemetry_at)
        return points.update(frame.image_bgr, frame.captured_ns, self._motion)

    def _hear(self, captured_ns: int, telemetry_at: Callable[[int], Telemetry]) -> None:
        """Add what became known of the motion since the last picture."""
        newest = telemetry_at(captured_ns)
        if self._epoch is not None and newest.epoch != self._epoch:
            self.clear()
        self._epoch = newest.epoch
        heard = [at_ns for at_ns in (self._attitude_ns, self._position_ns) if at_ns is not None]
        if heard and captured_ns < max(heard):
            self.clear()
        since_ns = captured_ns - _LONGEST_LOOK_BACK_NS
        at_ns = max(since_ns, min(self._attitude_ns or since_ns, self._position_ns or since_ns))
        while at_ns + _SAMPLE_NS < captured_ns:
            at_ns += _SAMPLE_NS
            self._add(at_ns, telemetry_at(at_ns))
        self._add(captured_ns, newest)

    def _add(self, at_ns: int, telemetry: Telemetry) -> None:
        if telemetry.at_ns != at_ns:
            return
        telemetry = telemetry.steady
        attitude = telemetry.attitude
        is_new = self._attitude_ns is None or at_ns > self._attitude_ns
        if attitude is not None and is_new and self._motion.add_attitude(at_ns, attitude):
            self._attitude_ns = at_ns
        position, velocity = telemetry.position_ned_m, telemetry.velocity_ned_mps
        is_new = self._position_ns is None or at_ns > self._position_ns
        if position is None or velocity is None or not is_new:
            return
        if self._motion.add_position(at_ns, position, velocity):
            self._position_ns = at_ns
