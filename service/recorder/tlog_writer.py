"""The telemetry log beside a record, as Mission Planner and QGroundControl read it."""

from __future__ import annotations

import struct
from pathlib import Path

from service.recorder.disk_file import DiskFile

_STX = (0xFE, 0xFD)
_LONGEST = 280


class PacketCutter:
    """Cuts one direction's bytes into whole packets, by their length alone."""

    def __init__(self) -> None:
        self._buffer = bytearray()

    def cut(self, data: bytes) -> list[bytes]:
        """The packets that the next bytes complete; what belongs to none is left out."""
        buffer = self._buffer
        buffer += data
        packets, start = [], 0
        while start < len(buffer):
            if buffer[start] not in _STX:
                start += 1
                continue
            length = _packet_length(buffer, start)
            if length is None or start + length > len(buffer):
                break
            end = start + length
            if end < len(buffer) and buffer[end] not in _STX:
                start += 1
                continue
            packets.append(bytes(buffer[start:end]))
            start = end
        del buffer[:start]
        if len(buffer) > _LONGEST:
            buffer.clear()
        return packets


def _packet_length(buffer: bytearray, start: int) -> int | None:
    if len(buffer) - start < 3:
        return None
    payload = buffer[start + 1]
    if buffer[start] == _STX[0]:
        return payload + 8
    return payload + (25 if buffer[start + 2] & 1 else 12)


class TlogWriter:
    """Writes 8 bytes of big-endian microseconds since 1970 before each packet.

    Args:
        path: the new file; nothing is overwritten.

    Raises:
        OSError: it exists, or cannot be made.
    """

    def __init__(self, path: Path) -> None:
        self._file = DiskFile(path)
        self._cutters: dict[tuple[bool, int], PacketCutter] = {}

    @property
    def size(self) -> int:
        """Bytes so far."""
        return self._file.size

    def write(self, data: bytes, wall_ns: int, *, outgoing: bool, sender: int = 0) -> None:
        """Write the packets that these bytes of the line complete. Raises OSError."""
        cutter = self._cutters.setdefault((outgoing, sender), PacketCutter())
        for packet in cutter.cut(data):
            self._file.write(struct.pack(">Q", max(0, wall_ns) // 1000) + packet)

    def flush(self) -> None:
        """Hand everything to the system. Raises OSError."""
        self._file.flush()

    def close(self) -> None:
        """Close; never raises."""
        self._file.close()
