"""STATUSTEXT: a few words for the pilot, not a flood."""

from __future__ import annotations

from collections import deque

from pymavlink.dialects.v20 import ardupilotmega as mavlink

_CHUNK_BYTES = 50
_MAX_CHUNKS = 4
_SAME_TEXT_NS = 10_000_000_000
_LEAST_GAP_NS = 500_000_000
_QUEUED_TEXTS = 8


class StatusTexts:
    """A queue of texts: the same one at most every 10 s, two a second in all, eight waiting."""

    def __init__(self) -> None:
        self._queue: deque[tuple[int, str]] = deque(maxlen=_QUEUED_TEXTS)
        self._said_ns: dict[str, int] = {}
        self._next_ns = 0
        self._next_id = 1

    def say(self, severity: int, text: str, now_ns: int) -> bool:
        """Queue a text; False if it was said less than 10 s ago.

        Args:
            severity: MAV_SEVERITY, 0 (emergency) to 7 (debug); others are taken to the nearer end.
            text: cut after 200 bytes; what is not ASCII becomes "?".
        """
        self._said_ns = {old: at for old, at in self._said_ns.items() if now_ns - at < _SAME_TEXT_NS}
        if text in self._said_ns:
            return False
        self._said_ns[text] = now_ns
        self._queue.append((min(7, max(0, severity)), text))
        return True

    def due(self, now_ns: int) -> list[mavlink.MAVLink_statustext_message]:
        """The chunks of one text, if one may be said now."""
        if not self._queue or now_ns < self._next_ns:
            return []
        severity, text = self._queue.popleft()
        self._next_ns = now_ns + _LEAST_GAP_NS
        data = text.encode("ascii", "replace").replace(b"\0", b"?")[: _CHUNK_BYTES * _MAX_CHUNKS]
        chunks = [data[i : i + _CHUNK_BYTES] for i in range(0, len(data), _CHUNK_BYTES)] or [b""]
        if len(chunks) == 1:
            return [mavlink.MAVLink_statustext_message(severity, chunks[0])]
        if len(chunks[-1]) == _CHUNK_BYTES:
            chunks.append(b"")  # a text ends at the first chunk that is not full
        text_id, self._next_id = self._next_id, self._next_id % 65535 + 1
        return [
            mavlink.MAVLink_statustext_message(severity, chunk, text_id, index)
            for index, chunk in enumerate(chunks)
        ]
