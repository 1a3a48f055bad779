"""A station that talks with a simulated autopilot in stepped time."""

from __future__ import annotations

from collections import Counter
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.fake_autopilot.autopilot import Flavor, SimulatedAutopilot, make_controller

STEP_S = 0.005


class Station:
    """A peer of a simulated autopilot: sends whole packets, keeps what it hears."""

    def __init__(self, autopilot: SimulatedAutopilot, component: int = 196) -> None:
        self.autopilot = autopilot
        self.channel = autopilot.open_channel()
        self.codec = mavlink.MAVLink(None, srcSystem=1, srcComponent=component)
        self.passed_on: list[bytes] = []

    def send(self, message: Any) -> None:
        packet = message.pack(self.codec)
        (received,) = mavlink.MAVLink(None).parse_buffer(packet)
        self.autopilot.receive(self.channel, received)

    def command(self, command: int, *values: float, system: int = 1) -> None:
        self.send(
            mavlink.MAVLink_command_long_message(system, 1, command, 0, *values, *[0] * (7 - len(values)))
        )

    def hear(self, seconds: float = 0.0) -> list[Any]:
        """Let time pass and take everything that was said."""
        for _ in range(round(seconds / STEP_S)):
            self.autopilot.step(STEP_S)
        own, passed_on = self.autopilot.collect(self.channel)
        self.passed_on += passed_on
        return own

    def answer(self, kind: str) -> Any:
        (found,) = [message for message in self.hear() if message.get_type() == kind]
        return found

    def result(self, command: int, *values: float) -> int:
        self.command(command, *values)
        ack = self.answer("COMMAND_ACK")
        assert ack.command == command
        return int(ack.result)


def autopilot(flavor: Flavor = "ardupilot", boot_s: float = 60.0, **changes: Any) -> SimulatedAutopilot:
    return SimulatedAutopilot(make_controller(flavor, **changes), boot_s)


def obstacles(word: int = 500) -> Any:
    return mavlink.MAVLink_obstacle_distance_message(0, 4, [word] * 72, 5, 20, 2000, 5.0, -155.0, 12)


def kinds(messages: list[Any]) -> Counter[str]:
    return Counter(message.get_type() for message in messages)
