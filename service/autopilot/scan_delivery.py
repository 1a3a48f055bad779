"""The scan as it will be true when the autopilot reads it: latency made good."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from service.autopilot.telemetry_tracker import TelemetryTracker
from service.autopilot.transport_delay import TransportDelay
from uavdepth.attitude import Attitude
from uavdepth.scan.motion import PlanarPose, moved_scan
from uavdepth.scan.obstacle_scan import ObstacleScan, SectorState

_NO_TURN_RAD = math.radians(0.5)
"""Attitude at capture is known no better: a turn below it would only widen obstacles."""

_NO_WAY_M = 0.05
"""A centimetre of drift in hover must not move obstacles across the edges of elements."""


class ScanDelivery:
    """Turns a scan by the yaw since its capture and shortens it by the way flown since then.

    Both autopilots take a message for the moment in which they read it (measured: 0.3 s of latency cost
    0.9 m at 3.3 m/s), so the age includes the way to them.

    Args:
        tracker: what the vehicle did, and does.
        transport: how long a message is under way.
    """

    def __init__(self, tracker: TelemetryTracker, transport: TransportDelay) -> None:
        self._tracker = tracker
        self._transport = transport
        self.not_made_good = 0
        """Scans whose turn or way since capture was not known. Without attitude nothing stays clear."""

    def attitude(self, captured_ns: int, now_ns: int) -> Attitude | None:
        """Attitude when a message that leaves now is read; where that is not known, at capture."""
        there = self._tracker.predicted(now_ns + self._transport.estimate_ns).attitude
        return self._tracker.telemetry_at(captured_ns).attitude if there is None else there

    def scan(self, scan: ObstacleScan, captured_ns: int, now_ns: int) -> ObstacleScan:
        """`scan`, captured at `captured_ns`, for a message that leaves now.

        Where the turn since then is not known, no direction is clear any more. Obstacles stay where they
        were seen: the best warning that there is.
        """
        read_ns = now_ns + self._transport.estimate_ns
        # Steady: where the heading is reset in between, the nose has not turned.
        here, there = self._tracker.telemetry_at(captured_ns).steady, self._tracker.predicted(read_ns).steady
        if here.attitude is None or there.attitude is None:
            self.not_made_good += 1
            return _without_clear(scan)
        north_m = east_m = 0.0
        if there.velocity_ned_mps is None:
            self.not_made_good += 1
        else:
            # Integrated velocity: positions jump when the estimator is reset.
            before = here.velocity_ned_mps or there.velocity_ned_mps
            age_s = (read_ns - captured_ns) / 1e9
            north_m, east_m = (
                0.5 * age_s * (first + last)
                for first, last in zip(before[:2], there.velocity_ned_mps[:2], strict=True)
            )
        seen = PlanarPose(captured_ns, 0.0, 0.0, here.attitude.yaw_rad)
        turned_rad, way_m = seen.motion_to(PlanarPose(read_ns, north_m, east_m, there.attitude.yaw_rad))
        if abs(turned_rad) < _NO_TURN_RAD:
            turned_rad = 0.0
        if math.hypot(*way_m) < _NO_WAY_M:
            way_m = (0.0, 0.0)
        if turned_rad == 0.0 and way_m == (0.0, 0.0):
            return scan
        return moved_scan(scan, turned_rad, way_m)


def _without_clear(scan: ObstacleScan) -> ObstacleScan:
    state = np.where(scan.state == SectorState.CLEAR, SectorState.UNKNOWN, scan.state)
    return replace(scan, state=state.astype(np.uint8))
