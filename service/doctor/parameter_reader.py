"""Reads named parameters over a link that may lose every request and every answer."""

from __future__ import annotations

import math
import struct
from collections.abc import Iterable, Mapping
from types import MappingProxyType

from pymavlink.dialects.v20 import ardupilotmega as mavlink

_PER_TURN = 5
_TURN_NS = 100_000_000
"""Five names each 0.1 s: 2.7 kB/s with the answers, which 57600 baud carries."""

_RETRY_NS = 600_000_000
_MOST_TRIES = 8

_WHOLE_FORMATS = {
    mavlink.MAV_PARAM_TYPE_UINT8: "<Bxxx",
    mavlink.MAV_PARAM_TYPE_INT8: "<bxxx",
    mavlink.MAV_PARAM_TYPE_UINT16: "<Hxx",
    mavlink.MAV_PARAM_TYPE_INT16: "<hxx",
    mavlink.MAV_PARAM_TYPE_UINT32: "<I",
    mavlink.MAV_PARAM_TYPE_INT32: "<i",
}


class ParameterReader:
    """Asks with PARAM_REQUEST_READ by name until everything has answered or been asked often enough.

    Args:
        names: what to read, the most important first.
        bytewise: whole numbers lie byte by byte in the float field (PX4) instead of as its value
            (ArduPilot).
    """

    def __init__(self, names: Iterable[str], bytewise: bool) -> None:
        self._names = tuple(names)
        self._bytewise = bytewise
        self._tries = dict.fromkeys(self._names, 0)
        self._asked_ns: dict[str, int] = {}
        self._next_turn_ns = 0
        self._values: dict[str, float] = {}

    @property
    def values(self) -> Mapping[str, float]:
        """Those that have answered."""
        return MappingProxyType(self._values)

    @property
    def unanswered(self) -> tuple[str, ...]:
        """Those that have not, in order."""
        return tuple(name for name in self._names if name not in self._values)

    def is_done(self, now_ns: int) -> bool:
        """Everything has answered, or was asked eight times and given 0.6 s after the last."""
        return all(
            self._tries[name] >= _MOST_TRIES and now_ns - self._asked_ns[name] >= _RETRY_NS
            for name in self.unanswered
        )

    def requests(self, system_id: int, now_ns: int) -> list[mavlink.MAVLink_param_request_read_message]:
        """Requests that are due now."""
        if now_ns < self._next_turn_ns:
            return []
        due = [
            name
            for name in self.unanswered
            if self._tries[name] < _MOST_TRIES and now_ns - self._asked_ns.get(name, -_RETRY_NS) >= _RETRY_NS
        ][:_PER_TURN]
        if due:
            self._next_turn_ns = now_ns + _TURN_NS
        for name in due:
            self._tries[name] += 1
            self._asked_ns[name] = now_ns
        return [
            mavlink.MAVLink_param_request_read_message(
                system_id, mavlink.MAV_COMP_ID_AUTOPILOT1, name.encode("ascii"), -1
            )
            for name in due
        ]

    def on_value(self, message: mavlink.MAVLink_param_value_message) -> None:
        """Take a PARAM_VALUE; names that were not asked for, and values that are no number, are not kept."""
        name = _text(message.param_id)
        if name not in self._tries:
            return
        value = float(message.param_value)
        layout = _WHOLE_FORMATS.get(message.param_type) if self._bytewise else None
        if layout is not None:
            value = float(struct.unpack(layout, struct.pack("<f", value))[0])
        if math.isfinite(value):
            self._values[name] = value


def _text(value: str | bytes) -> str:
    text = value.decode("ascii", "replace") if isinstance(value, bytes) else value
    return text.rstrip("\0")
