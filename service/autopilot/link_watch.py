"""What is wrong with the conversation itself: silence, MAVLink 1, streams that do not come, strangers."""

from __future__ import annotations

from collections.abc import Sequence

from service.autopilot.notices import Notices, Problem
from service.autopilot.streams import WantedStream

_MAVLINK1_TEXT = (
    "the autopilot speaks MAVLink 1, in which OBSTACLE_DISTANCE does not exist: set SERIALn_PROTOCOL to 2 "
    "(ArduPilot) or MAV_PROTO_VER to 2 (PX4)"
)


class LinkWatch:
    """Tells each problem of the conversation once, and when it is over.

    Args:
        notices: where problems are told.
        endpoint: where the autopilot is looked for.
    """

    def __init__(self, notices: Notices, endpoint: str) -> None:
        self._notices = notices
        self._endpoint = endpoint
        self.mavlink1 = False
        """The autopilot's newest packet was MAVLink 1."""

    def protocol(self, mavlink1: bool) -> None:
        """The autopilot has sent a packet of this version."""
        self.mavlink1 = mavlink1
        if mavlink1:
            self._notices.problem(Problem.MAVLINK1, _MAVLINK1_TEXT)
        else:
            self._notices.over(Problem.MAVLINK1)

    def connected(self) -> None:
        """The autopilot is heard."""
        self._notices.over(Problem.SILENT)

    def silent(self, was_heard: bool) -> None:
        """Nothing has been heard for longer than the link's time limit."""
        text = "the autopilot has gone silent on" if was_heard else "no autopilot's HEARTBEAT has come on"
        self._notices.problem(Problem.SILENT, f"{text} {self._endpoint}")

    def streams(self, refused: Sequence[WantedStream]) -> None:
        """These streams were asked for several times and still do not come."""
        if not refused:
            self._notices.over(Problem.STREAMS)
            return
        missing = ", ".join(f"{stream.message} at {stream.rate_hz:g} Hz" for stream in refused)
        self._notices.problem(
            Problem.STREAMS, f"the autopilot does not send what it was asked for: {missing}"
        )

    def stranger(self, system_id: int, own_system_id: int) -> None:
        """Another autopilot is heard."""
        self._notices.problem(
            Problem.FOREIGN,
            f"another autopilot is heard (system {system_id}): listening to system {own_system_id} only",
        )
