"""MAVLink 2 signing of one link: which packets are believed, and the time stamps of our own."""

from __future__ import annotations

import hashlib
import hmac
from enum import Enum

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.autopilot.signing_key import SigningKey

LINK_ID = 196
"""Constant: ArduPilot knows 16 streams of (system, component, link id) until it is restarted (measured)."""

_STX_V2 = 0xFD
_FLAG_SIGNED = 0x01
_NEW_STREAM_BEHIND = 60 * 100_000
"""A stream not heard before may be 60 s behind the newest one; MAVLink counts in 10 microseconds."""


class Verdict(Enum):
    """What a packet's signature says."""

    GOOD = "good"
    UNSIGNED = "unsigned"
    WRONG = "wrong_signature"
    OLD = "old_timestamp"


class Signing:
    """The signing state of a link.

    Our own time stamps follow the autopilot's: they never come from this computer's clock, because a stamp
    that is ahead pushes the autopilot's clock, and one that is 60 s behind is refused (measured).

    Args:
        key: the shared secret.
    """

    def __init__(self, key: SigningKey) -> None:
        self._secret = key.secret
        self._streams: dict[tuple[int, int, int], int] = {}
        self._newest = 0
        self.state = mavlink.MAVLinkSigning()
        """What pymavlink signs with: give it to the codec that packs."""
        self.state.secret_key = key.secret
        self.state.link_id = LINK_ID
        self.state.sign_outgoing = True

    def verdict(self, frame: bytes | bytearray) -> Verdict:
        """Judge a whole frame whose checksum is right, and remember its time stamp if it is good.

        pymavlink's own check takes the time stamp over before it looks at the signature, so that one forged
        packet from the future would shut a stream out: here only a good signature counts.
        """
        if not is_signed(frame):
            return Verdict.UNSIGNED
        expected = hashlib.sha256(self._secret + bytes(frame[:-6])).digest()[:6]
        if not hmac.compare_digest(expected, bytes(frame[-6:])):
            return Verdict.WRONG
        stream, stamp = (frame[-13], frame[5], frame[6]), _time_stamp(frame)
        last = self._streams.get(stream)
        if stamp < self._newest - _NEW_STREAM_BEHIND if last is None else stamp <= last:
            return Verdict.OLD
        self._streams[stream] = stamp
        self._newest = max(self._newest, stamp)
        return Verdict.GOOD

    def follow(self, frame: bytes | bytearray) -> None:
        """Sign no earlier than this good frame of the autopilot, whose clock is the one that counts."""
        self.state.timestamp = max(self.state.timestamp, _time_stamp(frame))


def is_signed(frame: bytes | bytearray) -> bool:
    """Whether a whole frame carries a signature, right or wrong."""
    return frame[0] == _STX_V2 and bool(frame[2] & _FLAG_SIGNED)


def _time_stamp(frame: bytes | bytearray) -> int:
    """Of a signed frame, units of 10 microseconds since 2015."""
    return int.from_bytes(frame[-12:-6], "little")
