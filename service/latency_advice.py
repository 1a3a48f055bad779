"""What the measured latency means for the autopilot's parameters."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

from service.doctor.px4_checks import recommended_delay_s
from service.doctor.safe_speed import reaction_s, safe_speed_mps

_KEPT_M = 2.0
"""What should be left between vehicle and obstacle: AVOID_MARGIN without latency."""


@dataclass(frozen=True)
class Latency:
    """From capture to wire, over the last messages, milliseconds.

    Args:
        p50_ms, p95_ms: half and 19 of 20 messages were not slower.
    """

    p50_ms: float
    p95_ms: float


@dataclass(frozen=True)
class LatencyAdvice:
    """Parameters for a latency.

    Args:
        cp_delay_s: PX4's CP_DELAY, seconds.
        margin_m: ArduPilot's AVOID_MARGIN, metres.
    """

    cp_delay_s: float
    margin_m: float


def advise(latency_p95_ms: float, range_m: float) -> LatencyAdvice:
    """Parameters for a latency from capture to wire.

    The motion since a picture is made good before its scan is sent, but not what comes into view meanwhile
    nor the autopilot's own filters; so the margin grows by the way of a latency at the greatest speed from
    which the vehicle can stop within `range_m`.

    Args:
        latency_p95_ms: 19 of 20 messages were not slower.
        range_m: the scan's farthest distance.
    """
    latency_s = latency_p95_ms / 1000.0
    speed_mps = safe_speed_mps(range_m, _KEPT_M, reaction_s(latency_s, None))
    margin_m = math.ceil(10.0 * (_KEPT_M + speed_mps * latency_s) - 1e-6) / 10.0
    return LatencyAdvice(recommended_delay_s(latency_s), margin_m)


def advise_all(latencies: Iterable[Latency | None], range_m: float) -> LatencyAdvice | None:
    """Parameters for the slowest of several cameras; None where no latency is known.

    Args:
        latencies: of each camera, None where it is not known.
        range_m: the scan's farthest distance.
    """
    slowest_ms = max((known.p95_ms for known in latencies if known is not None), default=None)
    return None if slowest_ms is None else advise(slowest_ms, range_m)
