"""How the camera moved between two moments, and how well the autopilot knows it.

Velocity is integrated; the autopilot's position helps over longer gaps where it agrees. A position that
jumps (the estimator was reset) is not used across the jump, and nothing is used across a jump of velocity
or attitude, or across a gap in either: no motion rather than a wrong one.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from uavdepth.attitude import Attitude
from uavdepth.camera import CameraMount

_KEPT_NS = 6_000_000_000
_ATTITUDE_GAP_NS = 250_000_000
_VELOCITY_GAP_NS = 500_000_000
_ATTITUDE_AHEAD_NS = 60_000_000
"""Attitude is carried on by its last rate so far: two ATTITUDE messages at 30 Hz."""

_VELOCITY_AHEAD_NS = 250_000_000
"""Velocity is held so far: two LOCAL_POSITION_NED at 10 Hz, one of them lost."""

_LARGEST_TURN_RADPS = math.radians(500.0)
_SMALLEST_JUMP_RAD = math.radians(4.0)
"""An attitude that moves further between two messages than 500 deg/s explains was reset."""

_LARGEST_ACCELERATION_MPS2 = 25.0
_SMALLEST_JUMP_MPS = 0.8
_JUMP_SIGMAS = 5.0


@dataclass(frozen=True)
class MotionNoise:
    """One standard deviation of what the autopilot says, on each axis.

    Args:
        attitude_rad: of the attitude, radians.
        velocity_mps: of the velocity; its error is taken to last as long as a point is seen.
        position_m: of the position against where it was a second ago, metres.

    Raises:
        ValueError: a number that is not finite and above 0.
    """

    attitude_rad: float = math.radians(0.5)
    velocity_mps: float = 0.1
    position_m: float = 0.1

    def __post_init__(self) -> None:
        for name in ("attitude_rad", "velocity_mps", "position_m"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0):
                raise ValueError(f"{name} is {value}: a finite number above 0 is needed")


@dataclass(frozen=True, eq=False)
class CameraMotion:
    """Motion of the camera from one moment ("here") to another ("there").

    A point at X in here's camera axes is at `rotation @ (X + offset_m)` in there's.

    Args:
        rotation: (3, 3) takes vectors from here's camera axes into there's.
        offset_m: (3,) position of here's camera as seen from there's, in here's camera axes, metres.
        sigma_m: one standard deviation of each component of the offset, metres.
    """

    rotation: NDArray[np.float64]
    offset_m: NDArray[np.float64]
    sigma_m: float

    @property
    def baseline_m(self) -> float:
        """Distance between the two cameras, metres."""
        return float(np.linalg.norm(self.offset_m))


@dataclass(frozen=True, eq=False)
class _Velocity:
    velocity: NDArray[np.float64]
    travelled: NDArray[np.float64]
    drift: NDArray[np.float64]
    stretch: int
    position_stretch: int


@dataclass(frozen=True, eq=False)
class _Turned:
    ned_from_body: NDArray[np.float64]
    stretch: int


class VehicleMotion:
    """A few seconds of attitude, velocity and position of one vehicle, all on one clock.

    Times are passed in as nanoseconds on the clock of the pictures. A step back in time forgets what was
    known. Add messages as they come, or one sample at the time of each picture.

    Args:
        noise: how well the autopilot knows them.
    """

    def __init__(self, noise: MotionNoise | None = None) -> None:
        self.noise = noise or MotionNoise()
        self._attitude_ns: list[int] = []
        self._attitudes: list[_Turned] = []
        self._velocity_ns: list[int] = []
        self._velocities: list[_Velocity] = []

    def clear(self) -> None:
        """Forget everything."""
        for kept in (self._attitude_ns, self._attitudes, self._velocity_ns, self._velocities):
            kept.clear()

    def add_attitude(self, at_ns: int, attitude: Attitude) -> bool:
        """Add an ATTITUDE; False (and nothing added) if an angle is not finite or the time is not new."""
        angles = (attitude.roll_rad, attitude.pitch_rad, attitude.yaw_rad)
        if not all(math.isfinite(angle) for angle in angles):
            return False
        if self._attitude_ns and at_ns < self._attitude_ns[-1]:
            self.clear()
        stretch, matrix = 0, attitude.ned_from_body
        if self._attitude_ns:
            gap_ns, last = at_ns - self._attitude_ns[-1], self._attitudes[-1]
            if gap_ns == 0:
                return False
            turn = _angle(last.ned_from_body.T @ matrix)
            limit = max(_SMALLEST_JUMP_RAD, _LARGEST_TURN_RADPS * gap_ns * 1e-9)
            broken = gap_ns > _ATTITUDE_GAP_NS or turn > limit
            stretch = last.stretch + broken
        self._attitude_ns.append(at_ns)
        self._attitudes.append(_Turned(matrix, stretch))
        _forget(self._attitude_ns, self._attitudes)
        return True

    def add_position(self, at_ns: int, position_ned_m: ArrayLike, velocity_ned_mps: ArrayLike) -> bool:
        """Add a LOCAL_POSITION_NED; False (and nothing added) if it is not finite or the time is not new.

        Args:
            at_ns: time of the estimate.
            position_ned_m, velocity_ned_mps: (3,) each, metres and metres a second.
        """
        position, velocity = np.array(position_ned_m, float), np.array(velocity_ned_mps, float)
        if not (np.isfinite(position).all() and np.isfinite(velocity).all()):
            return False
        if self._velocity_ns and at_ns < self._velocity_ns[-1]:
            self.clear()
        if self._velocity_ns and at_ns == self._velocity_ns[-1]:
            return False
        self._velocities.append(self._joined(at_ns, position, velocity))
        self._velocity_ns.append(at_ns)
        _forget(self._velocity_ns, self._velocities)
        return True

    def between(self, here_ns: int, there_ns: int, mount: CameraMount) -> CameraMotion | None:
        """The camera's motion from `here_ns` to `there_ns` (either may be the earlier one), or None.

        None where attitude or velocity is not known at either time, or was lost or reset in between.
        """
        here, there = self._turned_at(here_ns), self._turned_at(there_ns)
        moved = self._moved(there_ns, here_ns)
        if here is None or there is None or moved is None or here.stretch != there.stretch:
            return None
        ned_from_here = here.ned_from_body @ mount.body_from_camera
        ned_from_there = there.ned_from_body @ mount.body_from_camera
        offset, sigma = moved
        offset = offset + (here.ned_from_body - there.ned_from_body) @ mount.position_body_m
        return CameraMotion(ned_from_there.T @ ned_from_here, ned_from_here.T @ offset, sigma)

    def knows(self, at_ns: int) -> bool:
        """Whether attitude and velocity are known at `at_ns`."""
        return self._turned_at(at_ns) is not None and self._moving_at(at_ns) is not None

    def _joined(self, at_ns: int, position: NDArray[np.float64], velocity: NDArray[np.float64]) -> _Velocity:
        if not self._velocity_ns:
            return _Velocity(velocity, np.zeros(3), position, 0, 0)
        last, gap_ns = self._velocities[-1], at_ns - self._velocity_ns[-1]
        gap_s = gap_ns * 1e-9
        change = float(np.linalg.norm(velocity - last.velocity))
        limit = max(_SMALLEST_JUMP_MPS, _LARGEST_ACCELERATION_MPS2 * gap_s)
        stretch = last.stretch + (gap_ns > _VELOCITY_GAP_NS or change > limit)
        travelled = last.travelled + 0.5 * gap_s * (velocity + last.velocity)
        drift = position - travelled
        jump = float(np.linalg.norm(drift - last.drift))
        # Between two messages even a poor position follows its velocity.
        slack = _JUMP_SIGMAS * (self.noise.velocity_mps * gap_s + self.noise.position_m)
        return _Velocity(velocity, travelled, drift, stretch, last.position_stretch + (jump > slack))

    def _moved(self, from_ns: int, to_ns: int) -> tuple[NDArray[np.float64], float] | None:
        """NED displacement and the standard deviation of each axis."""
        start, end = self._moving_at(from_ns), self._moving_at(to_ns)
        if start is None or end is None or start.stretch != end.stretch:
            return None
        sigma = self.noise.velocity_mps * abs(to_ns - from_ns) * 1e-9
        moved = end.travelled - start.travelled
        if start.position_stretch != end.position_stretch:
            return moved, sigma
        # Information of the integrated velocity and of the difference of two positions, added.
        variance, position_variance = sigma**2, 2 * self.noise.position_m**2
        drifted = end.drift - start.drift
        if np.abs(drifted).max() > 3.0 * math.sqrt(variance + position_variance):
            return moved, sigma
        share = variance / (variance + position_variance)
        return moved + share * drifted, math.sqrt(share * position_variance)

    def _moving_at(self, at_ns: int) -> _Velocity | None:
        index = bisect_right(self._velocity_ns, at_ns) - 1
        if index < 0:
            return None
        before, past_s = self._velocities[index], (at_ns - self._velocity_ns[index]) * 1e-9
        if index == len(self._velocities) - 1:
            if at_ns - self._velocity_ns[index] > _VELOCITY_AHEAD_NS:
                return None
            travelled = before.travelled + past_s * before.velocity
            return _Velocity(
                before.velocity, travelled, before.drift, before.stretch, before.position_stretch
            )
        after = self._velocities[index + 1]
        if past_s > 0 and after.stretch != before.stretch:
            return None
        share = past_s / ((self._velocity_ns[index + 1] - self._velocity_ns[index]) * 1e-9)
        velocity = before.velocity + share * (after.velocity - before.velocity)
        travelled = before.travelled + 0.5 * past_s * (before.velocity + velocity)
        if after.position_stretch != before.position_stretch:
            share = 0.0
        drift = before.drift + share * (after.drift - before.drift)
        return _Velocity(velocity, travelled, drift, before.stretch, before.position_stretch)

    def _turned_at(self, at_ns: int) -> _Turned | None:
        index = bisect_right(self._attitude_ns, at_ns) - 1
        if index < 0:
            return None
        past_ns, before = at_ns - self._attitude_ns[index], self._attitudes[index]
        if past_ns == 0:
            return before
        if index == len(self._attitudes) - 1:
            if past_ns > _ATTITUDE_AHEAD_NS or index == 0:
                return None
            earlier = self._attitudes[index - 1]
            if earlier.stretch != before.stretch:
                return None
            share = past_ns / (self._attitude_ns[index] - self._attitude_ns[index - 1])
            return _Turned(
                before.ned_from_body @ _part(earlier.ned_from_body, before.ned_from_body, share),
                before.stretch,
            )
        after = self._attitudes[index + 1]
        if after.stretch != before.stretch:
            return None
        share = past_ns / (self._attitude_ns[index + 1] - self._attitude_ns[index])
        turned = before.ned_from_body @ _part(before.ned_from_body, after.ned_from_body, share)
        return _Turned(turned, before.stretch)


def _part(first: NDArray[np.float64], second: NDArray[np.float64], share: float) -> NDArray[np.float64]:
    """`share` of the turn from one attitude to another, in the first one's body axes."""
    vector, _ = cv2.Rodrigues(first.T @ second)
    matrix, _ = cv2.Rodrigues(vector * share)
    return np.asarray(matrix, dtype=np.float64)


def _angle(rotation: NDArray[np.float64]) -> float:
    return math.acos(min(1.0, max(-1.0, (float(np.trace(rotation)) - 1.0) / 2.0)))


def _forget(times: list[int], values: list[_Turned] | list[_Velocity]) -> None:
    if times[-1] - times[0] > _KEPT_NS:
        old = bisect_right(times, times[-1] - _KEPT_NS)
        del times[:old], values[:old]
