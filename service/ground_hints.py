"""The ground below as a hint: what is known of it while the picture is new, and how wrong that proved."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from service.autopilot.quaternion import from_attitude, slerp, to_attitude
from service.telemetry import Telemetry
from service.trouble import Trouble
from service.vehicle_height import KnownHeight, VehicleHeight
from uavdepth.attitude import Attitude
from uavdepth.camera import CameraMount
from uavdepth.model.hints import GroundHint

_STEP_NS = 50_000_000
LAGS_NS = (_STEP_NS, 2 * _STEP_NS)
"""Where no attitude is known yet for the capture, it is carried on from so much earlier."""

LARGEST_TURN_RAD = math.radians(3.0)
"""A hint made with an attitude that proves to be further off is not kept to: the picture is measured anew."""

_DEPRESSION = math.tan(math.radians(15.0))
"""How far below the horizon the ground that matters is seen: an attitude that is off by an angle puts it off
by the angle over this, relative."""


@dataclass(frozen=True)
class KnownGround:
    """The ground as it is known at a picture's capture.

    Args:
        hint: what the network is told.
        height: where its height comes from.
    """

    hint: GroundHint
    height: KnownHeight

    def turn_rad(self, attitude: Attitude) -> float:
        """How far the hint's attitude is from the true one; yaw does not count."""
        cosine = float(self.hint.attitude.level_from_body[2] @ attitude.level_from_body[2])
        return math.acos(min(1.0, max(-1.0, cosine))) if math.isfinite(cosine) else math.pi

    def sigma(self, attitude: Attitude) -> float:
        """Relative standard deviation of distances that are told by the hint, now that attitude is known."""
        return math.hypot(self.height.relative_sigma, self.turn_rad(attitude) / _DEPRESSION)


class GroundHints:
    """Makes the ground hint from telemetry.

    Args:
        mount: how the camera sits on the vehicle.
        height: tells the height above the ground.
    """

    def __init__(self, mount: CameraMount, height: VehicleHeight) -> None:
        self._mount = mount
        self._height = height

    def clear(self) -> None:
        """Forget the height."""
        self._height.clear()

    def before(self, captured_ns: int, telemetry_at: Callable[[int], Telemetry]) -> KnownGround | Trouble:
        """The ground as it is known while the picture is still new, or why it is not.

        Args:
            captured_ns: capture time of the picture.
            telemetry_at: the vehicle at a time; its newest messages may not have arrived yet.
        """
        now = telemetry_at(captured_ns)
        return self.of(now, now.attitude or _carried_on(captured_ns, telemetry_at))

    def of(self, telemetry: Telemetry, attitude: Attitude | None) -> KnownGround | Trouble:
        """The ground at the telemetry's time, or why it is not known.

        Args:
            telemetry: the vehicle at the capture time.
            attitude: the one to use.
        """
        height = self._height.at(telemetry)
        if attitude is None or not _is_finite(attitude):
            return Trouble.NO_ATTITUDE
        if height is None:
            return Trouble.NO_HEIGHT if telemetry.height_m is None else Trouble.NO_GROUND
        return KnownGround(GroundHint(self._mount, attitude, height.height_m), height)


def _carried_on(captured_ns: int, telemetry_at: Callable[[int], Telemetry]) -> Attitude | None:
    """The attitude that the last known turn leads to, or None where none was heard lately."""
    for lag_ns in LAGS_NS:
        last = telemetry_at(captured_ns - lag_ns).steady.attitude
        if last is None or not _is_finite(last):
            continue
        earlier = telemetry_at(captured_ns - lag_ns - _STEP_NS).steady.attitude
        if earlier is None or not _is_finite(earlier):
            return last
        return to_attitude(slerp(from_attitude(earlier), from_attitude(last), 1.0 + lag_ns / _STEP_NS))
    return None


def _is_finite(attitude: Attitude) -> bool:
    return all(math.isfinite(angle) for angle in (attitude.roll_rad, attitude.pitch_rad, attitude.yaw_rad))
