"""The way of a scan from the pipeline to the line: refused, or told as it is true when it leaves."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Sequence

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.autopilot.obstacle_gate import Refusal
from service.autopilot.obstacle_sender import ObstacleSender
from service.autopilot.outbox import Outbox
from service.autopilot.profile_choice import ProfileChoice
from service.autopilot.rate_meter import RateMeter
from service.autopilot.scan_delivery import ScanDelivery
from service.autopilot.telemetry_tracker import TelemetryTracker
from service.autopilot.transport_delay import TransportDelay
from service.settings.autopilot import AutopilotSettings
from uavdepth.messages.autopilot_profile import AutopilotProfile
from uavdepth.messages.obstacle_distance import obstacle_words
from uavdepth.scan.obstacle_scan import ObstacleScan

_REMEMBERED_DELAYS = 450
"""Half a minute of messages at 15 Hz."""


class ObstacleOutput:
    """Takes scans as of their capture, and makes their messages at the moment in which they leave.

    Args:
        settings: the `[autopilot]` section.
        bytes_per_s: what the line may carry; 0 for no limit.
        tracker: what the vehicle did, and does.
        transport: how long a message is under way.
        choice: the autopilot's layout.
        outbox: where messages leave.
    """

    def __init__(
        self,
        settings: AutopilotSettings,
        bytes_per_s: int,
        tracker: TelemetryTracker,
        transport: TransportDelay,
        choice: ProfileChoice,
        outbox: Outbox,
    ) -> None:
        self._max_age_ns = round(settings.max_frame_age_s * 1e9)
        self._sender = ObstacleSender(settings, bytes_per_s)
        self._tracker = tracker
        self._delivery = ScanDelivery(tracker, transport)
        self._choice = choice
        self._outbox = outbox
        self._meter = RateMeter()
        self._captured_ns = 0
        self._delays_ms: deque[float] = deque(maxlen=_REMEMBERED_DELAYS)
        self._refused: Counter[str] = Counter()

    def offer(self, scan: ObstacleScan, captured_ns: int, now_ns: int, blocked: Refusal | None) -> bool:
        """Queue the scan of the frame captured at `captured_ns`, if it may be sent.

        Each frame is sent at most once, while it is fresh, at the rate that the line carries.

        Args:
            blocked: why nothing may leave at all; None if something may.

        Raises:
            ScanError: a scan that cannot be told.
        """
        profile = self._choice.profile
        refusal = blocked
        if refusal is None:
            attitude = self._tracker.telemetry_at(captured_ns).attitude
            refusal = self._sender.refusal(scan, captured_ns, now_ns, profile, attitude)
        if refusal is not None:
            self._refused[refusal.value] += 1
            return False
        obstacle_words(scan)  # what cannot be told is its maker's trouble, not that of the link's thread
        self._sender.accept(scan, captured_ns, now_ns)
        self._captured_ns = captured_ns

        def at_leaving(leaving_ns: int) -> Sequence[mavlink.MAVLink_message]:
            return self._messages(scan, captured_ns, leaving_ns, profile)

        self._outbox.put_obstacles(at_leaving, captured_ns + self._max_age_ns)
        return True

    def _messages(
        self, scan: ObstacleScan, captured_ns: int, now_ns: int, profile: AutopilotProfile
    ) -> Sequence[mavlink.MAVLink_message]:
        return self._sender.messages(
            self._delivery.scan(scan, captured_ns, now_ns),
            captured_ns,
            self._tracker.autopilot_us(captured_ns, now_ns),
            profile,
            self._delivery.attitude(captured_ns, now_ns),
        )

    def left(self, scans: int, now_ns: int) -> None:
        """So many scans have left now."""
        if scans:
            self._delays_ms.append((now_ns - self._captured_ns) / 1e6)
        self._meter.add(now_ns, scans)

    def sends_points(self) -> bool:
        """Whether the autopilot gets OBSTACLE_DISTANCE_3D."""
        return self._sender.sends_points(self._choice.profile)

    @property
    def complaint(self) -> str | None:
        """What is wrong with a line that carries too little; None if it carries enough."""
        return self._sender.complaint

    @property
    def limit_hz(self) -> float:
        """Scans a second at most."""
        return self._sender.rate_hz

    @property
    def not_made_good(self) -> int:
        """Scans whose turn or way since capture was not known."""
        return self._delivery.not_made_good

    @property
    def refused(self) -> dict[str, int]:
        """Scans that were not sent, by reason."""
        return dict(self._refused)

    @property
    def delay_ms(self) -> tuple[float, float] | None:
        """Half and 19 of 20 scans went from capture to the line in so many milliseconds; None before one."""
        if not self._delays_ms:
            return None
        p50, p95 = np.percentile(self._delays_ms, [50, 95])
        return float(p50), float(p95)

    def rate_hz(self, now_ns: int) -> float:
        """Scans a second, over the last two."""
        return self._meter.per_second(now_ns)
