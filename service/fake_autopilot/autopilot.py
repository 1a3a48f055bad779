"""A simulated autopilot with its MAVLink face: messages in, messages out, stepped in time; no sockets, no
threads."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.fake_autopilot.ardupilot import ArduPilot
from service.fake_autopilot.commands import COMPONENT_ID, answer_command, obey
from service.fake_autopilot.controller import Controller
from service.fake_autopilot.parameters import (
    ARDUPILOT_DEFAULTS,
    PX4_DEFAULTS,
    PX4_WHOLE,
    Parameters,
    UnknownParameterError,
)
from service.fake_autopilot.px4 import Px4
from service.fake_autopilot.streams import StreamSchedule
from service.fake_autopilot.telemetry_messages import BUILDERS, DEFAULT_RATES_HZ
from service.fake_autopilot.world import World

Flavor = Literal["ardupilot", "px4"]

LINK_DROPS_AFTER_S = 0.20
BOOT_BEGINS_AFTER_S = 0.40
LINK_BACK_AFTER_S = 0.71
HEARTBEAT_AFTER_S = 1.39
"""Reboot of ArduCopter's simulator, seconds after the command (measured)."""

START_UP_S = 2.0
"""Message intervals asked for so early after boot are acknowledged and lost (measured: lost below 2,
honoured at 3 s)."""

POSITION_AFTER_S = 41.8
"""LOCAL_POSITION_NED begins here after boot, when the estimator uses GPS (measured)."""

TIMESYNC_PERIOD_S = 10.0
UNIX_AT_BOOT_US = 1_795_300_000_000_000


@dataclass
class Channel:
    """One link of the autopilot: its own streams, and what waits to be sent.

    Args:
        streams: message intervals of this link.
        waiting: messages of the autopilot itself.
        forwarded: whole packets of other systems, passed on unchanged.
    """

    streams: StreamSchedule
    waiting: list[Any] = field(default_factory=list)
    forwarded: list[bytes] = field(default_factory=list)
    timesync_s: float = -math.inf


def make_controller(
    flavor: Flavor,
    world: World | None = None,
    system_id: int = 1,
    parameters: Mapping[str, float] | None = None,
    position_ned_m: tuple[float, float, float] = (0.0, 0.0, 0.0),
    yaw_rad: float = 0.0,
) -> Controller:
    """Build the flight controller of a flavor.

    Raises:
        ValueError: unknown flavor, or a system id outside 1 to 255.
        UnknownParameterError: a parameter that the flavor does not have.
    """
    if not 1 <= system_id <= 255:
        raise ValueError(f"system id {system_id} is outside 1 to 255")
    if flavor == "ardupilot":
        table = Parameters({**ARDUPILOT_DEFAULTS, "MAV_SYSID": system_id})
    elif flavor == "px4":
        table = Parameters({**PX4_DEFAULTS, "MAV_SYS_ID": system_id}, PX4_WHOLE)
    else:
        raise ValueError(f"unknown flavor {flavor!r}: ardupilot or px4")
    for name, value in (parameters or {}).items():
        table.set(name, value)
    kind = ArduPilot if flavor == "ardupilot" else Px4
    return kind(world, table, system_id, position_ned_m, yaw_rad)


class SimulatedAutopilot:
    """A flight controller and what it says and hears on its channels.

    Args:
        controller: the vehicle and its modes.
        boot_s: how long ago the autopilot was started; 0 is a cold start with everything that is lost in one.
        position_after_s: LOCAL_POSITION_NED begins so long after boot.
    """

    def __init__(
        self, controller: Controller, boot_s: float = 60.0, position_after_s: float = POSITION_AFTER_S
    ) -> None:
        self.controller = controller
        self.boot_s = boot_s
        self.reboots = 0
        self.time_requests_answered = 0
        self._clock_step_s = 0.0
        self._position_after_s = position_after_s
        self._rebooting_s: float | None = None
        self._channels: dict[int, Channel] = {}
        self._next_channel = 0
        controller.position_is_known = boot_s >= position_after_s

    @property
    def time_boot_s(self) -> float:
        """Seconds since boot as the autopilot believes: its own clock, with the steps made to it."""
        return max(self.boot_s + self._clock_step_s, 0.0)

    @property
    def link_is_up(self) -> bool:
        """False while a reboot keeps the ports closed."""
        since = self._rebooting_s
        return since is None or since < LINK_DROPS_AFTER_S or since >= LINK_BACK_AFTER_S

    @property
    def is_silent(self) -> bool:
        """True from the moment a reboot drops the links to the first heartbeat."""
        return self._rebooting_s is not None and self._rebooting_s >= LINK_DROPS_AFTER_S

    def open_channel(self) -> int:
        """A link is there: its heartbeat goes out with the next step. Returns the channel's number."""
        number = self._next_channel
        self._next_channel += 1
        self._channels[number] = Channel(StreamSchedule(DEFAULT_RATES_HZ))
        return number

    def close_channel(self, number: int) -> None:
        """A link is gone, and its message intervals with it."""
        self._channels.pop(number, None)

    def reboot(self) -> None:
        """Start again: motors off, requests lost, time since boot from 0. A vehicle in the air falls."""
        if self._rebooting_s is None:
            self._rebooting_s = 0.0

    def lose_streams(self) -> None:
        """Forget every message interval that was asked for, without a reboot."""
        for channel in self._channels.values():
            channel.streams.reset()

    def step_clock(self, seconds: float) -> None:
        """Make the autopilot's own clock jump."""
        self._clock_step_s += seconds

    def step(self, dt_s: float) -> None:
        """Let `dt_s` seconds pass."""
        self.boot_s += dt_s
        self.controller.step(dt_s)
        if isinstance(self.controller, ArduPilot) and self.controller.aborted:
            self.reboot()
        self._go_on_rebooting(dt_s)
        self.controller.position_is_known = self.boot_s >= self._position_after_s
        self._queue_texts()
        if not self.is_silent:
            for channel in self._channels.values():
                self._queue_streams(channel)

    def receive(self, number: int, message: Any) -> None:
        """A message came in on a channel. Messages for other systems, and unknown ones, are not looked at."""
        channel = self._channels.get(number)
        if channel is None or self.is_silent:
            return
        sender = (message.get_srcSystem(), message.get_srcComponent())
        if sender == (self.controller.system_id, COMPONENT_ID):
            return  # nobody else is 1/1: the one sender that is refused (measured)
        self._forward(number, message)
        if getattr(message, "target_system", 0) not in (0, self.controller.system_id):
            return
        kind = message.get_type()
        if kind in ("COMMAND_LONG", "COMMAND_INT"):
            self._command(channel, message)
        elif kind == "TIMESYNC":
            if message.tc1 == 0:
                received_ns = round(self.time_boot_s * 1e9)
                channel.waiting.append(mavlink.MAVLink_timesync_message(received_ns, message.ts1))
                self.time_requests_answered += 1
        elif kind.startswith("PARAM_"):
            self._parameter(channel, kind, message)
        else:
            obey(self.controller, kind, message)

    def collect(self, number: int) -> tuple[list[Any], list[bytes]]:
        """Take what waits on a channel: own messages, and packets passed on from other links."""
        channel = self._channels.get(number)
        if channel is None:
            return [], []
        own, passed_on = channel.waiting, channel.forwarded
        channel.waiting, channel.forwarded = [], []
        return own, passed_on

    def _command(self, channel: Channel, message: Any) -> None:
        answer = answer_command(self, channel.streams, message)
        self._queue_texts()  # the reason of a refusal comes before the refusal
        channel.waiting.append(
            mavlink.MAVLink_command_ack_message(
                message.command, answer.result, 0, 0, message.get_srcSystem(), message.get_srcComponent()
            )
        )
        channel.waiting.extend(answer.messages)
        for message_id in answer.requested:
            channel.waiting.extend(self._build(message_id))
        if answer.interval is not None and self.boot_s >= START_UP_S:
            channel.streams.set_interval(*answer.interval)

    def _parameter(self, channel: Channel, kind: str, message: Any) -> None:
        parameters = self.controller.parameters
        try:
            if kind == "PARAM_REQUEST_LIST":
                channel.waiting.extend(parameters.message(name) for name in parameters)
            elif kind == "PARAM_REQUEST_READ":
                name = (
                    parameters.name_at(message.param_index)
                    if message.param_index >= 0
                    else _text(message.param_id)
                )
                channel.waiting.append(parameters.message(name or ""))
            elif kind == "PARAM_SET":
                name = _text(message.param_id)
                parameters.set_from_wire(name, message.param_value, message.param_type)
                channel.waiting.append(parameters.message(name))
        except UnknownParameterError:
            return  # real autopilots say nothing either

    def _forward(self, number: int, message: Any) -> None:
        """Pass heartbeats and obstacle messages on to the other links, unchanged (measured)."""
        if message.get_type() not in ("HEARTBEAT", "OBSTACLE_DISTANCE", "STATUSTEXT"):
            return
        for other, channel in self._channels.items():
            if other != number:
                channel.forwarded.append(bytes(message.get_msgbuf()))

    def _queue_texts(self) -> None:
        texts = self.controller.texts
        while texts:
            severity, text = texts.popleft()
            if self.is_silent:
                continue
            for channel in self._channels.values():
                channel.waiting.append(mavlink.MAVLink_statustext_message(severity, text.encode()[:50]))

    def _queue_streams(self, channel: Channel) -> None:
        for message_id in channel.streams.due(self.controller.now_s):
            channel.waiting.extend(self._build(message_id))
        if self.controller.now_s - channel.timesync_s >= TIMESYNC_PERIOD_S:
            channel.timesync_s = self.controller.now_s
            channel.waiting.append(mavlink.MAVLink_timesync_message(0, round(self.time_boot_s * 1e9)))

    def _build(self, message_id: int) -> list[Any]:
        builder = BUILDERS.get(message_id)
        if builder is None:
            return []
        return builder(self.controller, self.time_boot_s, UNIX_AT_BOOT_US + round(self.time_boot_s * 1e6))

    def _go_on_rebooting(self, dt_s: float) -> None:
        if self._rebooting_s is None:
            return
        before, self._rebooting_s = self._rebooting_s, self._rebooting_s + dt_s
        if before < BOOT_BEGINS_AFTER_S <= self._rebooting_s:
            self.reboots += 1
            self.boot_s = 0.0
            self._clock_step_s = 0.0
            self.controller.power_up()
            for channel in self._channels.values():
                channel.streams.reset()
                channel.waiting.clear()
                channel.forwarded.clear()
        if self._rebooting_s >= HEARTBEAT_AFTER_S:
            self._rebooting_s = None


def _text(value: str | bytes) -> str:
    text = value.decode("ascii", "replace") if isinstance(value, bytes) else value
    return text.rstrip("\0")
