"""Telemetry logs of ground stations: 8 bytes of big-endian microseconds, then a MAVLink packet."""

from __future__ import annotations

import re
from pathlib import Path

from service.errors import RecordError
from service.replay.footage import Packets

_STX_V1, _STX_V2 = 0xFE, 0xFD
_STX = re.compile(rb"[\xfd\xfe]")
_MAX_BYTES = 2 * 1024 * 1024 * 1024
_FEWEST_US, _MOST_US = 0, 2**62 // 1000


def read_tlog(path: Path) -> list[Packets]:
    """The packets of a `.tlog`, at nanoseconds of the clock that it was written with.

    Both directions are in such a file and are not told apart; garbage between packets is skipped.

    Raises:
        RecordError: it cannot be read, or holds no packet.
    """
    try:
        if path.stat().st_size > _MAX_BYTES:
            raise RecordError(f"{path}: more than {_MAX_BYTES} bytes")
        data = path.read_bytes()
    except OSError as error:
        raise RecordError(f"{path}: cannot be read: {error.strerror}") from error
    packets, position = [], 0
    while position + 8 + 8 <= len(data):
        length = _packet_length(data, position + 8)
        end = position + 8 + (length or 0)
        at_us = int.from_bytes(data[position : position + 8], "big")
        follows = end == len(data) or (end + 8 < len(data) and data[end + 8] in (_STX_V1, _STX_V2))
        if length is None or end > len(data) or not follows or not _FEWEST_US <= at_us <= _MOST_US:
            # On to the next byte that may begin a packet: a foreign file of gigabytes must not take an hour.
            start = _STX.search(data, position + 9)
            if start is None:
                break
            position = start.start() - 8
            continue
        packets.append(Packets(at_us * 1000, data[position + 8 : end]))
        position = end
    if not packets:
        raise RecordError(f"{path}: is no .tlog: it holds no MAVLink packet with a time before it")
    packets.sort(key=lambda packet: packet.at_ns)
    return packets


def _packet_length(data: bytes, start: int) -> int | None:
    if data[start] == _STX_V1:
        return data[start + 1] + 8
    if data[start] == _STX_V2:
        return data[start + 1] + (25 if data[start + 2] & 1 else 12)
    return None
