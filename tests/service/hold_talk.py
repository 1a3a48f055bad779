"""A vehicle that is asked to stop, in stepped time."""

from __future__ import annotations

from dataclasses import dataclass, field

from link_support import Conversation, Voice
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.autopilot.hold_request import HoldOutcome

S, MS = 1_000_000_000, 1_000_000


@dataclass
class Talk:
    """A session beside a vehicle that answers what the test wants."""

    autopilot: int = mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA
    kind: int = mavlink.MAV_TYPE_QUADROTOR
    mode: int = 5
    talk: Conversation = field(default_factory=lambda: Conversation(S))
    voice: Voice = field(default_factory=Voice)

    def __post_init__(self) -> None:
        self.beat(self.mode)

    def beat(self, mode: int) -> None:
        self.talk.hear(self.voice.heartbeat(self.kind, self.autopilot, custom_mode=mode))

    def ask(self) -> str:
        """Ask, and let the vehicle tell its mode, so that the request leaves; the mode that is asked for."""
        mode = self.talk.session.ask_to_hold()
        self.talk.wait_s(0.05)
        self.beat(self.mode)
        self.talk.wait_s(0.05)
        return mode

    def answer(self, result: int, component: int = 196) -> None:
        ack = mavlink.MAVLink_command_ack_message(mavlink.MAV_CMD_DO_SET_MODE, result, 0, 0, 1, component)
        self.talk.hear(self.voice.pack(ack))

    @property
    def commands(self) -> list[tuple[float, float, int]]:
        """Main mode, sub mode and confirmation of the requests sent."""
        return [
            (m.param2, m.param3, m.confirmation)
            for _, m in self.talk.sent_of("COMMAND_LONG")
            if m.command == mavlink.MAV_CMD_DO_SET_MODE
        ]

    @property
    def mode_requests(self) -> int:
        """How often the vehicle was asked for a HEARTBEAT."""
        heartbeat = (mavlink.MAV_CMD_REQUEST_MESSAGE, mavlink.MAVLINK_MSG_ID_HEARTBEAT)
        return sum((m.command, m.param1) == heartbeat for _, m in self.talk.sent_of("COMMAND_LONG"))

    @property
    def outcome(self) -> HoldOutcome | None:
        return self.talk.session.status(self.talk.now_ns).hold
