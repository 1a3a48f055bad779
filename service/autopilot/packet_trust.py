"""Whether a packet is believed, and what is said about those that are not."""

from __future__ import annotations

from collections import Counter

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.autopilot.notices import Notices, Problem
from service.autopilot.signing import Signing, Verdict, is_signed
from service.autopilot.vehicle import could_be_autopilot

_TEXTS = {
    Verdict.UNSIGNED: "the autopilot's packets are not signed: set the key up there, or leave "
    "signing_key_file empty",
    Verdict.WRONG: "the autopilot's packets are signed with another key than the one in signing_key_file",
    Verdict.OLD: "the autopilot's packets carry time stamps that were seen before: a replay, or its signing "
    "clock was set back",
}
_KEY_MISSING_TEXT = (
    "the autopilot signs its packets and signing_key_file is empty: it ignores ours on every link but the "
    "first, without a word"
)


class PacketTrust:
    """Believes everything until there is a key, and then only what is signed with it.

    Args:
        notices: where problems are told.
    """

    def __init__(self, notices: Notices) -> None:
        self._notices = notices
        self.signing: Signing | None = None
        self.refused: Counter[str] = Counter()
        """Packets that were not believed, by what was wrong with their signature."""

    def believes(self, message: mavlink.MAVLink_message, connected: bool) -> bool:
        """Whether the signature is right; nothing else of a packet may be looked at before.

        Args:
            connected: an autopilot that is believed is there. Then forged packets are only counted, so that
                they cannot fill the log.
        """
        if self.signing is None:
            return True
        verdict = self.signing.verdict(message.get_msgbuf())
        if verdict is Verdict.GOOD:
            return True
        self.refused[verdict.value] += 1
        if not connected and could_be_autopilot(message):
            self._notices.problem(Problem.SIGNING, _TEXTS[verdict])
        return False

    def on_vehicle(self, message: mavlink.MAVLink_message) -> None:
        """A packet of the vehicle, believed."""
        frame = message.get_msgbuf()
        if self.signing is not None:
            self.signing.follow(frame)
        elif is_signed(frame):
            self._notices.problem(Problem.SIGNING, _KEY_MISSING_TEXT)
            return
        self._notices.over(Problem.SIGNING)
