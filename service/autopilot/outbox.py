"""Frames on their way out: packed, bounded, what matters first, and dropped when they are too old."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.autopilot.byte_budget import OBSTACLE_BYTES, ByteBudget
from service.autopilot.presence import COMPONENT_ID
from service.autopilot.signing import Signing

_MAX_WAITING = 64
_FRAME_BYTES, _SIGNATURE_BYTES = 12, 13

Packed = tuple[mavlink.MAVLink_message, bytes]

AtLeaving = Callable[[int], Sequence[mavlink.MAVLink_message]]
"""Makes a scan's messages for the moment, nanoseconds on the service's clock, in which they leave."""


@dataclass(frozen=True)
class _Waiting:
    """Messages that leave together or not at all."""

    messages: tuple[mavlink.MAVLink_message, ...]
    expires_ns: int | None


class Outbox:
    """Packs messages as MAVLink 2. HEARTBEAT and obstacles leave first; requests and time, and after them
    texts, only from what those leave of the budget.

    Args:
        bytes_per_s: what the line may carry; 0 for no limit.
    """

    def __init__(self, bytes_per_s: int = 0) -> None:
        self._codec = mavlink.MAVLink(None, srcSystem=1, srcComponent=COMPONENT_ID)
        self._signed = False
        self._budget = ByteBudget(bytes_per_s)
        self._heartbeat: _Waiting | None = None
        self._obstacles: tuple[AtLeaving, int] | None = None
        self._others: deque[_Waiting] = deque()
        self._texts: deque[_Waiting] = deque()
        self.sent_obstacles = 0
        """Scans whose messages were taken."""
        self.dropped = 0
        """Messages that grew too old, or had no room."""

    def set_system_id(self, system_id: int) -> None:
        """Send as this system from now on."""
        self._codec.srcSystem = system_id

    def sign_with(self, signing: Signing) -> None:
        """Sign every frame from now on."""
        self._codec.signing, self._signed = signing.state, True

    def put(self, message: mavlink.MAVLink_message, expires_ns: int | None = None) -> None:
        """Queue a message. The oldest is dropped when 64 wait; of HEARTBEAT only the newest waits.

        Args:
            expires_ns: service time after which it must not leave any more.
        """
        waiting = _Waiting((message,), expires_ns)
        if message.get_type() == "HEARTBEAT":
            self.dropped += self._heartbeat is not None
            self._heartbeat = waiting
            return
        queue = self._texts if message.get_type() == "STATUSTEXT" else self._others
        queue.append(waiting)
        if len(queue) > _MAX_WAITING:
            queue.popleft()
            self.dropped += 1

    def put_obstacles(self, at_leaving: AtLeaving, expires_ns: int) -> None:
        """Queue one scan's messages, which leave together, instead of a scan that still waits."""
        self.dropped += self._obstacles is not None
        self._obstacles = (at_leaving, expires_ns)

    def take(self, now_ns: int) -> list[Packed]:
        """All messages that may leave now, with their frames."""
        taken: list[Packed] = []
        self._heartbeat = self._take_or_keep(self._heartbeat, now_ns, 0, taken)
        self._take_obstacles(now_ns, taken)
        for queue in (self._others, self._texts):
            while queue:
                if self._take_or_keep(queue[0], now_ns, OBSTACLE_BYTES, taken) is not None:
                    return taken
                queue.popleft()
        return taken

    def clear(self) -> None:
        """Drop everything."""
        self._heartbeat, self._obstacles = None, None
        self._others.clear()
        self._texts.clear()

    def _take_obstacles(self, now_ns: int, taken: list[Packed]) -> None:
        if self._obstacles is None:
            return
        at_leaving, expires_ns = self._obstacles
        messages = tuple(at_leaving(now_ns)) if now_ns <= expires_ns else ()
        if not messages:
            self.dropped += 1
            self._obstacles = None
            return
        before = len(taken)
        if self._take_or_keep(_Waiting(messages, expires_ns), now_ns, 0, taken) is None:
            self._obstacles = None
            self.sent_obstacles += len(taken) > before

    def _take_or_keep(
        self, waiting: _Waiting | None, now_ns: int, keep_bytes: int, taken: list[Packed]
    ) -> _Waiting | None:
        """Add the frames to `taken` or drop what is too old; returns what has to wait on."""
        if waiting is None:
            return None
        if waiting.expires_ns is not None and now_ns > waiting.expires_ns:
            self.dropped += len(waiting.messages)
            return None
        if not self._budget.spend(sum(map(self._size, waiting.messages)), now_ns, keep_bytes):
            return waiting
        for message in waiting.messages:
            taken.append((message, bytes(message.pack(self._codec))))
            self._codec.seq = (self._codec.seq + 1) % 256
        return None

    def _size(self, message: mavlink.MAVLink_message) -> int:
        """Bytes on the wire at most: MAVLink 2 leaves zeros at the end of a message out."""
        return int(message.unpacker.size) + _FRAME_BYTES + (_SIGNATURE_BYTES if self._signed else 0)
