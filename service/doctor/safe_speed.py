"""How fast a vehicle may come towards something so as to stop in front of it."""

from __future__ import annotations

import math

BRAKING_MPS2 = 1.0
"""ArduPilot never plans harder (measured)."""

REACTION_S = 0.12
"""Reproduces the speeds measured with a 2 m margin: 3.3 m/s at 8 m of range, 5.0 at 15 m, 5.9 at 20 m."""


def reaction_s(latency_s: float | None, filter_hz: float | None) -> float:
    """Seconds between something coming into range and the vehicle braking.

    Args:
        latency_s: from capture to wire, or None where it is not known (then it counts as none).
        filter_hz: ArduPilot's PRX_FILT. A first-order low-pass lags a ramp by 1 / (2 pi f): 0.64 s at the
            default of 0.25 Hz, 2.1 m at 3.3 m/s (measured: 2.1 to 2.4 m). 0 and None are no filter.
    """
    lag_s = 1.0 / (2.0 * math.pi * filter_hz) if filter_hz and filter_hz > 0.0 else 0.0
    return REACTION_S + max(latency_s or 0.0, 0.0) + lag_s


def safe_speed_mps(range_m: float, margin_m: float, reaction_time_s: float) -> float:
    """Largest speed v with v t + v^2 / 2a = range - margin, in m/s; 0 if the margin leaves no room."""
    room_m = range_m - max(margin_m, 0.0)
    if room_m <= 0.0:
        return 0.0
    lost = BRAKING_MPS2 * reaction_time_s
    return math.sqrt(lost * lost + 2.0 * BRAKING_MPS2 * room_m) - lost
