"""The autopilot's time since boot, unwrapped, and the reboots that it betrays."""

from __future__ import annotations

_WRAP_MS = 1 << 32
_REORDERED_MS = 500
"""A stamp this far back is an old datagram or a sensor's own delay; further back is another boot."""

_WRAP_SLACK_MS = 10_000
"""A wrap advances the stamp by about the time that has passed; this is what a stalled link may add."""


class BootTime:
    """Unwraps `time_boot_ms` (32 bits, 49.7 days) and notices when it begins again."""

    def __init__(self) -> None:
        self.reboots = 0
        self._raw_ms: int | None = None
        self._unwrapped_ms = 0
        self._arrival_ns = 0

    def unwrap(self, raw_ms: int, arrival_ns: int) -> int:
        """Take the stamp of a message.

        Args:
            raw_ms: time_boot_ms as received.
            arrival_ns: when it was received, nanoseconds on the service's clock.

        Returns:
            Time since boot in nanoseconds that does not wrap. After a reboot it begins again and
            `reboots` has grown by one.
        """
        if self._raw_ms is None:
            self._follow(raw_ms, raw_ms, arrival_ns)
            return raw_ms * 1_000_000
        forward_ms = (raw_ms - self._raw_ms) % _WRAP_MS
        backward_ms = (self._raw_ms - raw_ms) % _WRAP_MS
        elapsed_ms = (arrival_ns - self._arrival_ns) // 1_000_000
        if backward_ms <= _REORDERED_MS and self._unwrapped_ms >= backward_ms:
            return (self._unwrapped_ms - backward_ms) * 1_000_000
        if raw_ms >= self._raw_ms or forward_ms <= elapsed_ms + _WRAP_SLACK_MS:
            self._follow(raw_ms, self._unwrapped_ms + forward_ms, arrival_ns)
        else:
            self.reboots += 1
            self._follow(raw_ms, raw_ms, arrival_ns)
        return self._unwrapped_ms * 1_000_000

    def locate(self, raw_ms: int) -> int | None:
        """Nanoseconds since boot of a stamp near the newest one, without learning from it.

        For stamps that a sensor's driver made and that prove nothing about the clock. None if the stamp
        is more than 0.5 s from the newest, or nothing has been unwrapped yet.
        """
        if self._raw_ms is None:
            return None
        ahead_ms = (raw_ms - self._raw_ms + _WRAP_MS // 2) % _WRAP_MS - _WRAP_MS // 2
        if abs(ahead_ms) > _REORDERED_MS:
            return None
        return (self._unwrapped_ms + ahead_ms) * 1_000_000

    def _follow(self, raw_ms: int, unwrapped_ms: int, arrival_ns: int) -> None:
        self._raw_ms, self._unwrapped_ms, self._arrival_ns = raw_ms, unwrapped_ms, arrival_ns
