"""How many bytes a second a link may carry, and what fits into them."""

from __future__ import annotations

from service.autopilot.endpoint import SerialEndpoint, parse_endpoint

OBSTACLE_BYTES = 192
"""A signed OBSTACLE_DISTANCE on the wire; 179 without a signature."""

POINT_BYTES = 53
"""A signed OBSTACLE_DISTANCE_3D on the wire."""

LEAST_RATE_HZ = 10.0
"""Below it ArduPilot stops visibly later: 1.16 m from a wall at 12.5 Hz, 0.90 m at 5 Hz (measured)."""

OTHER_BYTES_PER_S = 150
"""Kept for HEARTBEAT, TIMESYNC and the requests for telemetry, without which there are no distances."""

LEAST_BYTES_PER_S = 2100
"""Carries `LEAST_RATE_HZ` and the rest."""

_BITS_PER_BYTE = 10
"""8N1: a start and a stop bit."""

_SERIAL_SHARE = 0.8
"""Part of a serial port's bytes that is used: a line that is always full is a queue."""

_DEPTH_BYTES = 400
"""Two OBSTACLE_DISTANCE: what may leave at once."""

_MOST_POINTS = 48
"""Two thirds of a circle of 5 degree elements: more than cameras that look forward see."""

_DEPTH_S = 0.05
"""On faster links what may leave at once, in seconds of the budget."""


def bytes_per_s_of(setting: int, endpoint: str) -> int:
    """The budget of a link: the setting, or where that is 0, of the serial port's rate; 0 is unlimited."""
    if setting or not endpoint.startswith("serial:"):
        return setting
    serial = parse_endpoint(endpoint)
    if not isinstance(serial, SerialEndpoint):
        return setting
    return max(1, int(serial.baud / _BITS_PER_BYTE * _SERIAL_SHARE))


def obstacle_rate_hz(wanted_hz: float, bytes_per_s: int, scan_bytes: int = OBSTACLE_BYTES) -> float:
    """Scans a second that fit, at most `wanted_hz`; at least 1 on whatever line.

    Args:
        bytes_per_s: the budget; 0 for no limit.
        scan_bytes: what one scan takes.
    """
    if not bytes_per_s:
        return wanted_hz
    return min(wanted_hz, max(1.0, (bytes_per_s - OTHER_BYTES_PER_S) / scan_bytes))


def points_in_a_burst(bytes_per_s: int) -> int:
    """OBSTACLE_DISTANCE_3D of one scan, which ArduPilot wants within 50 ms (measured); at most 48."""
    return min(_MOST_POINTS, int(bytes_per_s * _DEPTH_S / POINT_BYTES)) if bytes_per_s else _MOST_POINTS


class ByteBudget:
    """A bucket that fills steadily; what does not fit may not leave now.

    Args:
        bytes_per_s: how fast it fills; 0 for no limit.
    """

    def __init__(self, bytes_per_s: int) -> None:
        self.bytes_per_s = bytes_per_s
        self._depth = max(_DEPTH_BYTES, _DEPTH_S * bytes_per_s)
        self._level = float(self._depth)
        self._filled_ns: int | None = None

    def spend(self, size: int, now_ns: int, keep: int = 0) -> bool:
        """Take `size` bytes if as many are there and `keep` remain; False, and nothing taken, if not."""
        if not self.bytes_per_s:
            return True
        if self._filled_ns is not None:
            elapsed_s = max(0, now_ns - self._filled_ns) / 1e9
            self._level = min(self._depth, self._level + elapsed_s * self.bytes_per_s)
        self._filled_ns = now_ns
        # What is larger than the bucket leaves when the bucket is full, and is paid for afterwards.
        if self._level < min(size + keep, self._depth):
            return False
        self._level -= size
        return True
