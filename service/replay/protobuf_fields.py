"""The few fields of Foxglove's messages that replays read, from bytes that need not be trusted."""

from __future__ import annotations

from service.errors import RecordError

_VARINT, _FIXED64, _BYTES, _FIXED32 = 0, 1, 2, 5


def protobuf_fields(data: bytes) -> dict[int, int | bytes]:
    """Field number to value: whole numbers (unsigned) and bytes; the last of a repeated field counts.

    Raises:
        RecordError: it is no protobuf message.
    """
    fields: dict[int, int | bytes] = {}
    position = 0
    while position < len(data):
        key, position = _varint(data, position)
        number, kind = key >> 3, key & 7
        if kind == _VARINT:
            fields[number], position = _varint(data, position)
            continue
        if kind == _BYTES:
            length, position = _varint(data, position)
        elif kind in (_FIXED64, _FIXED32):
            length = 8 if kind == _FIXED64 else 4
        else:
            raise RecordError(f"a recorded message has a field of unknown kind {kind}")
        if length > len(data) - position:
            raise RecordError(f"a recorded message is cut off: {length} bytes are claimed")
        inside = data[position : position + length]
        fields[number] = inside if kind == _BYTES else int.from_bytes(inside, "little")
        position += length
    return fields


def _varint(data: bytes, position: int) -> tuple[int, int]:
    value = 0
    for shift in range(0, 70, 7):
        if position >= len(data):
            raise RecordError("a recorded message is cut off inside a number")
        byte = data[position]
        position += 1
        value |= (byte & 0x7F) << shift
        if byte < 0x80:
            return value, position
    raise RecordError("a recorded message holds a number of more than 64 bits")
