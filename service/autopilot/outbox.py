"""Frames on their way out, packed, bounded, and dropped when they are too old."""

from __future__ import annotations

from collections import deque

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.autopilot.presence import COMPONENT_ID
from service.autopilot.signing import Signing

_MAX_FRAMES = 64


class Outbox:
    """Packs messages as MAVLink 2 in the order in which they leave."""

    def __init__(self) -> None:
        self._codec = mavlink.MAVLink(None, srcSystem=1, srcComponent=COMPONENT_ID)
        self._queue: deque[tuple[mavlink.MAVLink_message, int | None]] = deque(maxlen=_MAX_FRAMES)

    def set_system_id(self, system_id: int) -> None:
        """Send as this system from now on."""
        self._codec.srcSystem = system_id

    def sign_with(self, signing: Signing) -> None:
        """Sign every frame from now on."""
        self._codec.signing = signing.state

    def put(self, message: mavlink.MAVLink_message, expires_ns: int | None = None) -> None:
        """Queue a message; the oldest is dropped when 64 wait.

        Args:
            expires_ns: service time after which it must not leave any more.
        """
        self._queue.append((message, expires_ns))

    def take(self, now_ns: int) -> list[tuple[mavlink.MAVLink_message, bytes]]:
        """All messages that may still leave, with their frames."""
        taken = []
        while self._queue:
            message, expires_ns = self._queue.popleft()
            if expires_ns is None or now_ns <= expires_ns:
                taken.append((message, message.pack(self._codec)))
                self._codec.seq = (self._codec.seq + 1) % 256
        return taken

    def clear(self) -> None:
        """Drop everything."""
        self._queue.clear()
