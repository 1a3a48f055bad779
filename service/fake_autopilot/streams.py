"""Which messages go out on one link, and how often."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

DEFAULT_INTERVAL_US = 0
DISABLED_INTERVAL_US = -1
FASTEST_INTERVAL_S = 0.005


class StreamSchedule:
    """Message intervals of one link, as SET_MESSAGE_INTERVAL changes them.

    Args:
        default_rates_hz: message id to rate after power-up.
    """

    def __init__(self, default_rates_hz: Mapping[int, float]) -> None:
        self._defaults_s = {message_id: 1.0 / rate for message_id, rate in default_rates_hz.items()}
        self._intervals_s: dict[int, float] = {}
        self._due_s: dict[int, float] = {}
        self.reset()

    def reset(self) -> None:
        """Forget every request: what a reboot does."""
        self._intervals_s = dict(self._defaults_s)
        self._due_s = dict.fromkeys(self._intervals_s, -math.inf)

    def set_interval(self, message_id: int, interval_us: float) -> None:
        """Send a message each `interval_us` microseconds; 0 is the default rate, -1 is never."""
        if interval_us == DEFAULT_INTERVAL_US and message_id in self._defaults_s:
            interval_s = self._defaults_s[message_id]
        elif interval_us > 0:
            interval_s = max(interval_us * 1e-6, FASTEST_INTERVAL_S)
        else:
            self._intervals_s.pop(message_id, None)
            self._due_s.pop(message_id, None)
            return
        self._intervals_s[message_id] = interval_s
        self._due_s[message_id] = -math.inf

    def interval_us(self, message_id: int) -> int:
        """The interval in microseconds, -1 if the message is not sent."""
        interval_s = self._intervals_s.get(message_id)
        return DISABLED_INTERVAL_US if interval_s is None else round(interval_s * 1e6)

    def due(self, now_s: float) -> Iterable[int]:
        """Ids of the messages whose time has come; each then waits for its interval again."""
        for message_id, due_s in self._due_s.items():
            if now_s + 1e-9 < due_s:
                continue
            interval_s = self._intervals_s[message_id]
            # A late one does not make the following ones crowd together.
            self._due_s[message_id] = due_s + interval_s if now_s - due_s < interval_s else now_s + interval_s
            yield message_id
