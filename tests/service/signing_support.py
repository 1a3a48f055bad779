"""Autopilots that sign, and a link that knows their key."""

from __future__ import annotations

from pathlib import Path

from link_support import SECOND_NS as S
from link_support import TICK_NS, Voice, clear_scan
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.autopilot.link_status import LinkStatus
from service.autopilot.session import LinkSession
from service.autopilot.signing_key import SigningKey
from service.settings.autopilot import AutopilotSettings

KEY, OTHER_KEY = SigningKey(bytes(range(32))), SigningKey(bytes(range(1, 33)))
YEARS = 11 * 365 * 24 * 3600 * 100_000
"""A time stamp of these years: 10 microseconds since 2015."""
SECOND = 100_000


class SignedVoice(Voice):
    """An autopilot whose packets pymavlink signs."""

    def __init__(
        self, key: SigningKey = KEY, stamp: int = YEARS, link_id: int = 0, component_id: int = 1
    ) -> None:
        super().__init__(1, component_id)
        self.signing = self._codec.signing
        self.signing.secret_key, self.signing.timestamp = key.secret, stamp
        self.signing.link_id, self.signing.sign_outgoing = link_id, True


class Listener:
    """A MAVLink party that, like an autopilot, takes only packets signed with the key; pymavlink's check."""

    def __init__(self, key: SigningKey = KEY, stamp: int = YEARS) -> None:
        self.codec = mavlink.MAVLink(None)
        self.codec.signing.secret_key, self.codec.signing.timestamp = key.secret, stamp

    def takes(self, frame: bytes) -> bool:
        try:
            self.codec.decode(bytearray(frame))
        except mavlink.MAVError:
            return False
        return True


class Link:
    """A session with a key, and the frames that leave."""

    def __init__(self, key: SigningKey | None = KEY) -> None:
        self.session = LinkSession(AutopilotSettings(), key)
        self.now_ns = S
        self.session.line_opened(S)

    def hear(self, frame: bytes) -> None:
        self.session.receive(frame, self.now_ns)

    def speak(self, seconds: float = 0.02) -> list[bytes]:
        frames, end_ns = [], self.now_ns + round(seconds * S)
        while self.now_ns < end_ns:
            self.now_ns += TICK_NS
            self.session.tick(self.now_ns)
            frames += self.session.take_output(self.now_ns)
        return frames

    def send_obstacles(self) -> bool:
        return self.session.send_obstacles(clear_scan(), self.now_ns, self.now_ns)

    @property
    def status(self) -> LinkStatus:
        return self.session.status(self.now_ns)


def stamp_of(frame: bytes) -> int:
    return int.from_bytes(frame[-12:-6], "little")


def written(folder: Path, data: bytes) -> Path:
    path = folder / "signing.key"
    path.write_bytes(data)
    path.chmod(0o600)
    return path
