"""What an autopilot says of a known motion: with lasting and with fresh errors, as EKFs have them."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from service.motion_evaluation.journey import Said
from uavdepth.attitude import Attitude
from uavdepth.scenes.flight import Pose

LASTING_VELOCITY_MPS, FRESH_VELOCITY_MPS = 0.08, 0.06
LASTING_ATTITUDE_RAD, FRESH_ATTITUDE_RAD = math.radians(0.4), math.radians(0.3)
FRESH_POSITION_M = 0.03
LASTING_S = 5.0
"""Errors of velocity and attitude keep their direction for so long."""

RANGE_SHARE = 0.01
"""Fresh error of a rangefinder, relative."""

ATTITUDE_HZ, POSITION_HZ = 30, 15


@dataclass(frozen=True)
class _Drift:
    """A smooth random error of three axes: two sines each."""

    amplitude: float
    phases: np.ndarray

    def at(self, t_s: float) -> np.ndarray:
        rates = np.array([[1.0], [2.3]]) * (1.0 / LASTING_S)
        return np.asarray(self.amplitude * np.sin(rates * t_s + self.phases).sum(axis=0))


class ErringAutopilot:
    """Speaks of a motion, message by message.

    Args:
        pose_at: the true motion, by seconds.
        start_s: when it begins to speak.
        seed: of the errors.
    """

    def __init__(self, pose_at: Callable[[float], Pose], start_s: float, seed: int) -> None:
        self._pose_at = pose_at
        self._rng = np.random.default_rng([seed, 0xA070])
        # Two sines of one amplitude have that root mean square together.
        self._velocity = _Drift(LASTING_VELOCITY_MPS, self._rng.uniform(0, 2 * np.pi, (2, 3)))
        self._attitude = _Drift(LASTING_ATTITUDE_RAD, self._rng.uniform(0, 2 * np.pi, (2, 3)))
        self._offset = np.zeros(3)
        self._attitudes = math.floor(start_s * ATTITUDE_HZ)
        self._positions = math.floor(start_s * POSITION_HZ)

    def until(self, t_s: float) -> tuple[Said, ...]:
        """What it says from where it stopped up to `t_s`, in order of time."""
        said = []
        while self._attitudes / ATTITUDE_HZ <= t_s:
            at_s = self._attitudes / ATTITUDE_HZ
            said.append(Said(round(at_s * 1e9), attitude=self.attitude(at_s)))
            self._attitudes += 1
        while self._positions / POSITION_HZ <= t_s:
            at_s = self._positions / POSITION_HZ
            pose = self._pose_at(at_s)
            drift = self._velocity.at(at_s)
            self._offset = self._offset + drift / POSITION_HZ
            position = pose.position_ned_m + self._offset + self._rng.normal(0, FRESH_POSITION_M, 3)
            velocity = pose.velocity_ned_mps + drift + self._rng.normal(0, FRESH_VELOCITY_MPS, 3)
            said.append(Said(round(at_s * 1e9), position_ned_m=position, velocity_ned_mps=velocity))
            self._positions += 1
        return tuple(sorted(said, key=lambda each: each.at_ns))

    def attitude(self, t_s: float) -> Attitude:
        """What it believes its attitude to be."""
        true = self._pose_at(t_s).attitude
        roll, pitch, yaw = (
            np.array([true.roll_rad, true.pitch_rad, true.yaw_rad])
            + self._attitude.at(t_s)
            + self._rng.normal(0, FRESH_ATTITUDE_RAD, 3)
        ).tolist()
        return Attitude(roll, pitch, math.remainder(yaw, 2 * math.pi))

    def range_m(self, true_m: float) -> float:
        """What its rangefinder says of a distance."""
        return float(true_m * (1 + self._rng.normal(0, RANGE_SHARE)))
