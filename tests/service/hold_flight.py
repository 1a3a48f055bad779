"""A fake autopilot in the air, its pilot, and a link that may ask it to hold, stepped frame by frame."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.autopilot.session import LinkSession
from service.fake_autopilot.autopilot import Flavor, SimulatedAutopilot, make_controller
from service.fake_autopilot.controller import Sticks
from service.health import STALL_NS
from service.hold_on_loss import HoldOnLoss, Moment
from service.settings.autopilot import AutopilotSettings
from service.trouble import Trouble
from uavdepth.scan.obstacle_scan import SECTOR_COUNT, ObstacleScan, SectorState, sector_bearings_deg

STEP_S, TURN_S = 0.005, 0.02
_JUDGED_EVERY = 3
_SENT_EVERY = 4
"""Turns between two looks, and between two messages."""


class HoldFlight:
    """A vehicle at 5 m in a mode that distances act in.

    Args:
        flavor: of the autopilot.
        mode: that the pilot flies in.
        parameters: of the autopilot.
    """

    def __init__(self, flavor: Flavor, mode: str, **parameters: float) -> None:
        self.controller = make_controller(flavor, parameters=parameters)
        self._autopilot = SimulatedAutopilot(self.controller, 60.0)
        self._channel = self._autopilot.open_channel()
        self._codec = mavlink.MAVLink(None, srcSystem=1, srcComponent=1)
        self._session = LinkSession(AutopilotSettings())
        self._session.line_opened(0)
        self._on_loss = HoldOnLoss()
        self._turn = 0
        self._sent_ns: int | None = None
        self.trouble: Trouble | None = None
        """Why no distances are sent."""
        self.asked: list[Any] = []
        """The commands by which another mode was asked for."""
        self.controller.arm()
        self.controller.vehicle.down_m, self.controller.vehicle.landed = -5.0, False
        self.controller.set_mode(mode)
        self.fly(3.0)

    @property
    def speed_mps(self) -> float:
        """Along the nose."""
        return self.controller.vehicle.body_velocity_mps[0]

    def fly(self, seconds: float, stick: float = 0.0, until: Callable[[], bool] = lambda: False) -> None:
        """Let time pass with the stick so far ahead."""
        for _ in range(round(seconds / TURN_S)):
            if until():
                return
            self._turn += 1
            self.controller.set_sticks(Sticks(forward=stick))
            for _ in range(round(TURN_S / STEP_S)):
                self._autopilot.step(STEP_S)
            self._talk(round(self._turn * TURN_S * 1e9))

    def _talk(self, now_ns: int) -> None:
        own, passed_on = self._autopilot.collect(self._channel)
        self._session.receive(b"".join([*(m.pack(self._codec) for m in own), *passed_on]), now_ns)
        is_due = self.trouble is None and self._turn % _SENT_EVERY == 0
        if is_due and self._session.send_obstacles(all_clear(), now_ns, now_ns):
            self._sent_ns = now_ns
        if self._turn % _JUDGED_EVERY == 0:
            self._judge(now_ns)
        self._session.tick(now_ns)
        for frame in self._session.take_output(now_ns):
            (message,) = mavlink.MAVLink(None).parse_buffer(frame)
            self._autopilot.receive(self._channel, message)
            if message.get_type() == "COMMAND_LONG" and message.command == mavlink.MAV_CMD_DO_SET_MODE:
                self.asked.append(message)

    def _judge(self, now_ns: int) -> None:
        """As the monitor does."""
        link = self._session.status(now_ns)
        is_lost = self._sent_ns is None or now_ns - self._sent_ns > STALL_NS
        moment = Moment(
            now_ns,
            (self.trouble or Trouble.STARTING) if is_lost else None,
            self._sent_ns,
            bool(link.armed) and self._sent_ns is not None,
            link.connected,
            link.armed,
            link.autopilot,
            link.mode,
            self._session.newest_pose(now_ns),
        )
        if self._on_loss.hear(moment):
            self._session.ask_to_hold()


def all_clear() -> ObstacleScan:
    return ObstacleScan(
        np.full(SECTOR_COUNT, np.nan, np.float32),
        np.full(SECTOR_COUNT, SectorState.CLEAR, np.uint8),
        sector_bearings_deg(),
        0.2,
        20.0,
    )
