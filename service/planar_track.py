"""The vehicle's way seen from above, by its velocity: resets of the autopilot's position and heading leave it
alone."""

from __future__ import annotations

import math

from service.telemetry import Telemetry
from uavdepth.scan.motion import PlanarPose

_LONGEST_GAP_NS = 500_000_000
"""No scan is remembered for longer."""

_LARGEST_ACCELERATION_MPS2 = 20.0
_VELOCITY_NOISE_MPS = 1.0
"""A velocity that changes by more than so much and what a vehicle can accelerate was reset."""


class PlanarTrack:
    """Carries a pose along with the velocity. One thread; reads no clock.

    An estimator that finds its position wrong moves it by decimetres or metres at once, one that finds its
    heading wrong turns it by degrees, and the vehicle with everything that it has seen would jump. Over half
    a second the velocity tells the way to centimetres, and the nose turns as the body rates say.
    """

    def __init__(self) -> None:
        self._last: Telemetry | None = None
        self._north_m = self._east_m = 0.0

    def pose_at(self, telemetry: Telemetry) -> PlanarPose | None:
        """The pose at a moment after that of the last call, in a frame of the track's own.

        Returns:
            None where the way since the last call is not known: nothing seen before has a place any more.
        """
        telemetry = telemetry.steady
        last, self._last = self._last, telemetry
        attitude, velocity = telemetry.attitude, telemetry.velocity_ned_mps
        if attitude is None or velocity is None or not _are_finite(*velocity, attitude.yaw_rad):
            self._last = None
            return None
        if last is not None and last.velocity_ned_mps is not None:
            elapsed_ns = telemetry.at_ns - last.at_ns
            elapsed_s = elapsed_ns / 1e9
            before_north, before_east, _ = last.velocity_ned_mps
            change_mps = math.hypot(velocity[0] - before_north, velocity[1] - before_east)
            was_reset = change_mps > _LARGEST_ACCELERATION_MPS2 * abs(elapsed_s) + _VELOCITY_NOISE_MPS
            if last.epoch != telemetry.epoch or not 0 < elapsed_ns <= _LONGEST_GAP_NS or was_reset:
                return None
            self._north_m += 0.5 * elapsed_s * (before_north + velocity[0])
            self._east_m += 0.5 * elapsed_s * (before_east + velocity[1])
        return PlanarPose(telemetry.at_ns, self._north_m, self._east_m, attitude.yaw_rad)


def _are_finite(*values: float) -> bool:
    return all(math.isfinite(value) for value in values)
