"""Metres for a network that takes the ground as a hint: what it is told before it has seen the picture."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from service.scale_status import ScaleStatus
from service.telemetry import Telemetry
from service.trouble import Trouble
from uavdepth.attitude import Attitude
from uavdepth.body_rays import body_rays
from uavdepth.camera import CameraModel, CameraMount
from uavdepth.depth_map import DepthMap
from uavdepth.ground_scale import MIN_HEIGHT_M
from uavdepth.hints import GroundHint, Hints
from uavdepth.scale_tracker import DRIFT_PER_SQRT_S

LAGS_NS = (50_000_000, 100_000_000)
"""Where no attitude is known yet for the capture, it is asked for so much earlier."""

LARGEST_TURN_RAD = math.radians(3.0)
"""A hint made with an attitude that proves to be further off is a wrong one: at a depression of 15 degrees
it puts the ground 25 % off."""

_STRIDE = 8
"""The uncertainty below the horizon is taken from every eighth row and column."""


@dataclass(frozen=True)
class KnownGround:
    """The ground as it was known before the network ran.

    Args:
        hint: what the network is told.
        age_s: time since the height was heard, seconds.
    """

    hint: GroundHint
    age_s: float


@dataclass(frozen=True)
class _Height:
    at_ns: int
    height_m: float
    down_m: float | None


class GroundHints:
    """Makes the ground hint from telemetry, and says afterwards what metres that were made with it are worth.

    The height is held for a short while when the rangefinder falls silent, moved by what the autopilot's
    position says of the climb since.

    Args:
        camera, mount: the camera and how it sits on the vehicle.
        hold_s: how long a height is held, seconds.
    """

    def __init__(self, camera: CameraModel, mount: CameraMount, hold_s: float) -> None:
        self._mount = mount
        self._hold_s = hold_s
        self._rays = body_rays(camera, mount, _STRIDE)
        self._height: _Height | None = None

    def before(self, captured_ns: int, telemetry_at: Callable[[int], Telemetry]) -> KnownGround | Trouble:
        """The ground as it is known while the picture is still new, or why it is not.

        Args:
            captured_ns: capture time of the picture.
            telemetry_at: the vehicle at a time; its newest messages may not have arrived yet.
        """
        now = telemetry_at(captured_ns)
        attitude = now.attitude
        for lag_ns in LAGS_NS:
            attitude = attitude or telemetry_at(captured_ns - lag_ns).attitude
        held = self._hold(now)
        if attitude is None or not _is_finite(attitude):
            return Trouble.NO_ATTITUDE
        if held is None:
            return Trouble.NO_HEIGHT if now.height_m is None else Trouble.NO_GROUND
        height_m = held.height_m
        position = now.position_ned_m
        if held.down_m is not None and position is not None:
            height_m = max(MIN_HEIGHT_M, height_m + held.down_m - position[2])
        return KnownGround(GroundHint(self._mount, attitude, height_m), (captured_ns - held.at_ns) / 1e9)

    def after(self, ground: KnownGround, depth: DepthMap, attitude: Attitude) -> ScaleStatus | Trouble:
        """What the metres are worth, now that the attitude at capture is known.

        Args:
            ground: what the network was told.
            depth: its answer in metres.
            attitude: of the vehicle at the capture time.
        """
        if _turn_rad(ground.hint.attitude, attitude) > LARGEST_TURN_RAD:
            return Trouble.NO_ATTITUDE
        sigma = self._sigma_below_horizon(depth, attitude)
        return ScaleStatus(1.0, math.hypot(sigma, DRIFT_PER_SQRT_S * math.sqrt(ground.age_s)), ground.age_s)

    def _hold(self, telemetry: Telemetry) -> _Height | None:
        """The height to use at the telemetry's time: heard now or not long ago."""
        height_m = telemetry.height_m
        if height_m is not None and math.isfinite(height_m) and height_m >= MIN_HEIGHT_M:
            position = telemetry.position_ned_m
            self._height = _Height(telemetry.at_ns, height_m, None if position is None else position[2])
        if self._height is None or not 0 <= telemetry.at_ns - self._height.at_ns <= self._hold_s * 1e9:
            self._height = None
        return self._height

    def _sigma_below_horizon(self, depth: DepthMap, attitude: Attitude) -> float:
        """Median relative sigma of pixels below the horizon; of all pixels where none looks down.

        1 where the network says none: then half of the metres may be anything.
        """
        if depth.relative_sigma is None:
            return 1.0
        start = _STRIDE // 2
        sigma = depth.relative_sigma[start::_STRIDE, start::_STRIDE]
        looks_down = np.tensordot(attitude.level_from_body[2].astype(np.float32), self._rays, axes=1) > 0
        for values in (sigma[looks_down], sigma):
            finite = values[np.isfinite(values)]
            if finite.size:
                return float(np.median(finite))
        return 1.0


def hints_of(ground: KnownGround | Trouble) -> Hints:
    """What the network is given; nothing where the ground is not known."""
    return Hints(ground.hint) if isinstance(ground, KnownGround) else Hints()


def _is_finite(attitude: Attitude) -> bool:
    return math.isfinite(attitude.roll_rad) and math.isfinite(attitude.pitch_rad)


def _turn_rad(one: Attitude, other: Attitude) -> float:
    """Angle between two attitudes' down directions, seen from the body; yaw does not count."""
    cosine = float(one.level_from_body[2] @ other.level_from_body[2])
    return math.acos(min(1.0, max(-1.0, cosine))) if math.isfinite(cosine) else math.pi
