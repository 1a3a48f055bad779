"""The senders on a line, their bytes kept apart."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Hashable

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.autopilot.framing import FrameReader

_MAX_SOURCES = 8
"""Senders on a UDP port whose bytes are kept apart."""


class Sources:
    """One `FrameReader` for each sender; of too many, the one that was silent longest is forgotten."""

    def __init__(self) -> None:
        self._readers: OrderedDict[Hashable, FrameReader] = OrderedDict()
        self.bad_bytes = 0
        """Bytes that belonged to no frame."""

    def read(self, data: bytes, source: Hashable) -> list[mavlink.MAVLink_message]:
        """The messages that a sender's next bytes complete."""
        reader = self._readers.pop(source, None) or FrameReader()
        self._readers[source] = reader
        if len(self._readers) > _MAX_SOURCES:
            self._readers.popitem(last=False)
        before = reader.bad_bytes
        messages = reader.read(data)
        self.bad_bytes += reader.bad_bytes - before
        return messages

    def clear(self) -> None:
        """Forget what was begun: the line is new."""
        self._readers.clear()
