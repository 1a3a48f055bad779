"""`on_loss = "hold"`: when the autopilot is asked to stop because perception is lost, and when never."""

from __future__ import annotations

import math
from dataclasses import dataclass

from service.doctor.flight_modes import Effect, find_mode
from service.position_jump import has_jumped
from service.status import speed_mps
from service.telemetry import Telemetry
from service.trouble import Trouble
from uavdepth.attitude import Attitude
from uavdepth.camera import CameraModel, CameraMount

HOLD_AFTER_NS = 700_000_000
"""After the last message: a dropped picture or two is no loss, and ArduPilot opens the way 1.0 s after it at
the earliest (measured)."""

_WATCHED_NS = 5_000_000_000
"""So long after the loss a vehicle without metres, or one that is not heard, may still be asked."""

_NEVER_STOPPED = frozenset({"LAND"})
"""Every landing loses its metres near the ground: stopped there, the vehicle would hang in the air."""

_MOVING_MPS = 0.5
_CREPT_M = 1.0
"""A way since the loss that is no hovering in gusts any more, and half of the margin that is kept."""

_RECOVERED_NS = 3_000_000_000
"""Distances must have been sent for so long before a new loss may lead to a new request."""


_BODY_RAD = math.radians(10.0)
"""A vehicle that flies so far beside a camera's view still comes into it with its side."""


@dataclass(frozen=True)
class Sight:
    """Directions that a camera sees.

    Args:
        bearing_rad: of its axis from the nose, clockwise.
        half_width_rad: to either side of it.
    """

    bearing_rad: float
    half_width_rad: float

    @classmethod
    def of(cls, camera: CameraModel, mount: CameraMount) -> Sight:
        """From the left edge of the picture's middle row to the right one."""
        row = camera.normalized_rays[camera.height // 2] @ mount.body_from_camera.T
        left, axis, right = (math.atan2(row[x, 1], row[x, 0]) for x in (0, camera.width // 2, -1))
        return cls(axis, max(abs(math.remainder(edge - axis, math.tau)) for edge in (left, right)))

    def meets(self, way_ned: tuple[float, float], attitude: Attitude | None) -> bool:
        """Whether a way north and east leads into it; who knows no heading must think so."""
        if attitude is None:
            return True
        bearing = math.atan2(way_ned[1], way_ned[0]) - attitude.yaw_rad - self.bearing_rad
        return not abs(math.remainder(bearing, math.tau)) > self.half_width_rad + _BODY_RAD


@dataclass(frozen=True)
class Moment:
    """What the decision is made by.

    Args:
        now_ns: the moment.
        trouble: why no distances are sent, None if they are.
        sent_ns: when distances were sent last; None if never.
        protected: armed, and given distances since.
        heard: the autopilot is.
        armed: the vehicle's motors.
        autopilot, mode: of the vehicle; None if not known.
        pose: where it is and how fast, as far as known.
    """

    now_ns: int
    trouble: Trouble | None
    sent_ns: int | None
    protected: bool
    heard: bool
    armed: bool | None
    autopilot: str | None
    mode: str | None
    pose: Telemetry


class HoldOnLoss:
    """Asks once for each loss, for an armed vehicle that moves in a mode that distances act in.

    A vehicle moves if it is fast, or has come a metre without distances; where one camera of several is lost,
    into what that one saw. Where a part of the service has
    failed, one that hovers is watched until it moves, however late. Where only metres are missing it is
    watched for 5 s: moving is how they come back, and who hovers long has none.

    Who has chosen another mode since flies: nothing is asked of a pilot who has taken over, until the vehicle
    has been armed again or distances have been sent for 3 s.

    Args:
        sight: of the camera whose distances these are; None where all directions hang on them.
    """

    def __init__(self, sight: Sight | None = None) -> None:
        self._sight = sight
        self._mode_before: str | None = None
        """The mode that distances acted in while they were sent; None if none did."""
        self._is_over = False
        self._well_since_ns: int | None = None
        self._way = _Way()

    @property
    def way_m(self) -> float:
        """How far the vehicle has come since 0.7 s after the last distances, horizontally."""
        return self._way.length_m

    def hear(self, moment: Moment) -> bool:
        """Whether to ask now."""
        if moment.armed is False:
            self._mode_before, self._is_over, self._well_since_ns = None, False, None
            return False
        if moment.trouble is None:
            self._on_well(moment)
            return False
        self._well_since_ns = None
        silent_ns = moment.now_ns - (moment.sent_ns or 0)
        if silent_ns < HOLD_AFTER_NS:
            self._way.begin(moment.pose)
        else:
            self._way.go_on(moment.pose)
        if self._is_over or self._mode_before is None:
            return False
        if not moment.heard or moment.mode is None:
            self._is_over = silent_ns > _WATCHED_NS  # nobody knows what the pilot does meanwhile
            return False
        if moment.mode != self._mode_before:
            self._is_over = True  # the pilot has acted
            return False
        is_watched = moment.trouble.is_fault or silent_ns <= _WATCHED_NS
        if not moment.protected or silent_ns < HOLD_AFTER_NS or not is_watched:
            return False
        if not self._is_moving(moment.pose):
            return False
        self._is_over = True
        return True

    def _on_well(self, moment: Moment) -> None:
        if self._well_since_ns is None:
            self._well_since_ns = moment.now_ns
        if moment.now_ns - self._well_since_ns >= _RECOVERED_NS:
            self._is_over = False
        self._mode_before = moment.mode if _acts(moment.autopilot, moment.mode) else None

    def _is_moving(self, pose: Telemetry) -> bool:
        velocity, speed = pose.velocity_ned_mps, speed_mps(pose)
        is_fast = speed is not None and speed >= _MOVING_MPS
        if is_fast and velocity is not None and self._leads_there(velocity[:2], pose):
            return True
        return self._way.length_m >= _CREPT_M and self._leads_there(self._way.north_east_m, pose)

    def _leads_there(self, way_ned: tuple[float, float], pose: Telemetry) -> bool:
        return self._sight is None or self._sight.meets(way_ned, pose.attitude)


class _Way:
    """From where the vehicle was at one moment to where it is; a reset of its position is no way."""

    def __init__(self) -> None:
        self._last: Telemetry | None = None
        self._north_m = self._east_m = 0.0

    @property
    def north_east_m(self) -> tuple[float, float]:
        """The way."""
        return self._north_m, self._east_m

    @property
    def length_m(self) -> float:
        """As the crow flies, horizontally."""
        return math.hypot(self._north_m, self._east_m)

    def begin(self, pose: Telemetry) -> None:
        """Start here."""
        self._last = None
        self._north_m = self._east_m = 0.0
        self.go_on(pose)

    def go_on(self, pose: Telemetry) -> None:
        """The vehicle is here now; a pose without a position says nothing."""
        last = self._last
        if pose.position_ned_m is None or (last is not None and pose.at_ns <= last.at_ns):
            return
        if last is not None and last.position_ned_m is not None and not has_jumped(last, pose):
            self._north_m += pose.position_ned_m[0] - last.position_ned_m[0]
            self._east_m += pose.position_ned_m[1] - last.position_ned_m[1]
        self._last = pose


def _acts(autopilot: str | None, mode: str | None) -> bool:
    """Whether distances do anything in a mode that may be left for a stop."""
    if mode in _NEVER_STOPPED:
        return False
    row = find_mode(autopilot, mode) if autopilot is not None and mode is not None else None
    return row is not None and row.effect is not Effect.NOTHING
