"""Metres for a network that knows none: the ground in the picture, held through pictures without it."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from service.scale_status import ScaleStatus
from service.settings.scan import ScanSettings
from service.telemetry import Telemetry
from service.trouble import Trouble
from uavdepth.attitude import Attitude
from uavdepth.ground_scale import GroundScale
from uavdepth.scale_tracker import ScaleTracker


class ScaleSource(Protocol):
    """What tells the factor to metres from the ground."""

    def estimate(
        self, depth_m: NDArray[np.float32], attitude: Attitude, height_m: float
    ) -> GroundScale | None:
        """The factor, or None where not enough ground is seen."""


class ScaleFromGround:
    """The factor from the network's units to metres, from picture to picture.

    Args:
        scaler: tells it of one picture.
        settings: how long it is held.
    """

    def __init__(self, scaler: ScaleSource, settings: ScanSettings) -> None:
        self._scaler = scaler
        self._hold_without_height_s = settings.scale_hold_without_height_s
        self._tracker = ScaleTracker(settings.scale_hold_s)
        self._ground_seen_ns = 0

    def of(
        self, depth: NDArray[np.float32], attitude: Attitude, telemetry: Telemetry, captured_ns: int
    ) -> ScaleStatus | Trouble:
        """The scale to use for a picture, its ground's or one that is held.

        A vehicle that stopped before a wall sees no ground, and silence would open ArduPilot's path into
        the wall after 1 to 1.75 s (measured): so a scale is held long there, with a sigma that grows.

        Args:
            depth: (H, W) in the network's units; NaN where unknown.
            attitude, telemetry: the vehicle at the capture time.
            captured_ns: that time.
        """
        estimate = None
        if telemetry.height_m is not None:
            estimate = self._scaler.estimate(depth, attitude, telemetry.height_m)
        if estimate is not None:
            self._ground_seen_ns = captured_ns
        scale = self._tracker.update(estimate, captured_ns)
        age_s = (captured_ns - self._ground_seen_ns) / 1e9
        if telemetry.height_m is None and (scale is None or age_s > self._hold_without_height_s):
            return Trouble.NO_HEIGHT
        if scale is None:
            return Trouble.NO_GROUND
        return ScaleStatus(scale.factor, scale.relative_sigma, age_s)
