"""Bytes from a link, cut into MAVLink messages, whatever else lies between them."""

from __future__ import annotations

from pymavlink.dialects.v20 import ardupilotmega as mavlink

MESSAGE_IDS = frozenset(
    {
        mavlink.MAVLINK_MSG_ID_HEARTBEAT,
        mavlink.MAVLINK_MSG_ID_ATTITUDE,
        mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED,
        mavlink.MAVLINK_MSG_ID_TIMESYNC,
        mavlink.MAVLINK_MSG_ID_DISTANCE_SENSOR,
        mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION,
        mavlink.MAVLINK_MSG_ID_COMMAND_ACK,
    }
)
"""Messages that the link reads; the others are counted as bytes and skipped undecoded."""

_STX_V1, _STX_V2 = 0xFE, 0xFD
_FLAG_SIGNED = 0x01
_MAX_KEPT_BYTES = 1024
"""More than three of the longest frames (280 bytes): a partial frame never needs more."""


class FrameReader:
    """Cuts one byte stream into messages.

    After a broken frame the search goes on one byte later, not one frame later as in pymavlink's own
    parser, so that garbage costs no good frame behind it.
    """

    def __init__(self) -> None:
        self._codec = mavlink.MAVLink(None)
        self._buffer = bytearray()
        self.bad_bytes = 0
        """Bytes that belonged to no frame."""

    def read(self, data: bytes) -> list[mavlink.MAVLink_message]:
        """Take the next bytes of the stream and return the messages of `MESSAGE_IDS` that they complete."""
        buffer = self._buffer
        buffer += data
        messages: list[mavlink.MAVLink_message] = []
        start = 0
        while start < len(buffer):
            if buffer[start] not in (_STX_V1, _STX_V2):
                start += 1
                self.bad_bytes += 1
                continue
            length = _frame_length(buffer, start)
            if length is None or start + length > len(buffer):
                break
            frame = buffer[start : start + length]
            if length and self._take(frame, _followed_by_frame(buffer, start + length), messages):
                start += length
            else:
                start += 1
                self.bad_bytes += 1
        del buffer[:start]
        if len(buffer) > _MAX_KEPT_BYTES:
            self.bad_bytes += len(buffer)
            buffer.clear()
        return messages

    def _take(self, frame: bytearray, followed: bool, messages: list[mavlink.MAVLink_message]) -> bool:
        """Decode one frame; False if it is none. Frames that need no decoding count if another follows."""
        message_id = frame[5] if frame[0] == _STX_V1 else int.from_bytes(frame[7:10], "little")
        if message_id not in MESSAGE_IDS and followed:
            return True
        if message_id not in mavlink.mavlink_map:
            return False
        try:
            message = self._codec.decode(frame)
        except mavlink.MAVError:
            return False
        if message_id in MESSAGE_IDS:
            messages.append(message)
        return True


def _frame_length(buffer: bytearray, start: int) -> int | None:
    """Length of the frame that begins at `start`; None if that is not known yet, 0 if it cannot be one."""
    if len(buffer) - start < 3:
        return None
    payload = buffer[start + 1]
    if buffer[start] == _STX_V1:
        return payload + 8
    flags = buffer[start + 2]
    if flags & ~_FLAG_SIGNED:
        return 0
    return payload + (25 if flags & _FLAG_SIGNED else 12)


def _followed_by_frame(buffer: bytearray, end: int) -> bool:
    return end == len(buffer) or buffer[end] in (_STX_V1, _STX_V2)


def is_mavlink1(message: mavlink.MAVLink_message) -> bool:
    """Whether the message came in a MAVLink 1 frame, in which OBSTACLE_DISTANCE does not exist."""
    return bool(message.get_msgbuf()[0] == _STX_V1)
