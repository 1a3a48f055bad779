"""An examination beside a simulated autopilot, stepped in time without sockets."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.autopilot.signing import is_signed
from service.autopilot.signing_key import SigningKey
from service.doctor.checks import examine
from service.doctor.examination import Examination, plan_of
from service.doctor.finding import Finding
from service.doctor.observation import Observation
from service.fake_autopilot.autopilot import Flavor, SimulatedAutopilot, make_controller
from service.settings.autopilot import AutopilotSettings

STEP_S = 0.005
TURN_S = 0.02
SETTINGS = AutopilotSettings(endpoint="tcp:127.0.0.1:5760")


class Bench:
    """A doctor and its patient.

    Args:
        mavlink1: the autopilot speaks MAVLink 1.
        key: the autopilot signs with it.
        own_key: the doctor signs with it.
        loses: says of each message, in either direction, whether it is lost.
        probe: the trial is allowed.
        parameters: of the autopilot.
    """

    def __init__(
        self,
        flavor: Flavor = "ardupilot",
        mavlink1: bool = False,
        key: bytes | None = None,
        loses: Callable[[Any], bool] = lambda message: False,
        probe: bool = True,
        own_key: bytes | None = None,
        settings: AutopilotSettings = SETTINGS,
        **parameters: float,
    ) -> None:
        system_id = int(parameters.get("MAV_SYS_ID", 1))
        self.autopilot = SimulatedAutopilot(
            make_controller(flavor, system_id=system_id, parameters=parameters), 60.0
        )
        self.plan = replace(plan_of(settings, 0.2, 20.0, signs=own_key is not None), latency_s=0.1)
        self.examination = Examination(
            settings, self.plan, 20.0, None if own_key is None else SigningKey(own_key), probe
        )
        self.sent: Counter[str] = Counter()
        self.unsigned = 0
        self.now_ns = 0
        self._mavlink1, self._loses = mavlink1, loses
        self._channel = self.autopilot.open_channel()
        self._out = mavlink.MAVLink(None, srcSystem=system_id, srcComponent=1)
        if key is not None:
            self._out.signing.secret_key = key
            self._out.signing.sign_outgoing = True
        self.examination.line_opened(0)

    def run(self, seconds: float) -> Observation:
        """Let time pass, and say what the doctor has seen."""
        for _ in range(round(seconds / TURN_S)):
            self.now_ns += round(TURN_S * 1e9)
            for _ in range(round(TURN_S / STEP_S)):
                self.autopilot.step(STEP_S)
            own, passed_on = self.autopilot.collect(self._channel)
            data = b"".join([*(self._packed(message) for message in own), *passed_on])
            if data:
                self.examination.receive(data, self.now_ns)
            self.examination.tick(self.now_ns)
            for frame in self.examination.take_output(self.now_ns):
                (message,) = mavlink.MAVLink(None).parse_buffer(frame)
                self.sent[message.get_type()] += 1
                self.unsigned += not is_signed(frame)
                if not self._loses(message):
                    self.autopilot.receive(self._channel, message)
        return self.examination.observation(self.now_ns)

    def findings(self) -> dict[str, Finding]:
        """What the doctor says now, by topic."""
        return {
            finding.topic: finding
            for finding in examine(self.examination.observation(self.now_ns), self.plan)
        }

    def _packed(self, message: Any) -> bytes:
        if self._loses(message) or (self._mavlink1 and message.get_msgId() > 255):
            return b""
        packet = bytes(message.pack(self._out, force_mavlink1=self._mavlink1))
        self._out.seq = (self._out.seq + 1) % 256
        return packet
