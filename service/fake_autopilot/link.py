"""MAVLink on the fake autopilot's endpoints: packets to channels and back, with the link's faults in
between."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.fake_autopilot.autopilot import SimulatedAutopilot
from service.fake_autopilot.commands import COMPONENT_ID
from service.fake_autopilot.endpoint import Endpoint, Peer
from service.fake_autopilot.faults import FaultKind, FaultPlan

MAVLINK1_LARGEST_ID = 255


@dataclass
class _Peer:
    channel: int
    codec: Any
    held_in: list[bytes] = field(default_factory=list)
    held_out: list[bytes] = field(default_factory=list)


class AutopilotLinks:
    """All peers of all endpoints, each a channel of the autopilot.

    Args:
        autopilot: who talks.
        endpoints: opened endpoints; closed together with this.
        faults: pauses and bursts.
        mavlink1: send MAVLink 1 frames, without the messages that do not exist there.
    """

    def __init__(
        self,
        autopilot: SimulatedAutopilot,
        endpoints: list[Endpoint],
        faults: FaultPlan,
        mavlink1: bool = False,
    ) -> None:
        self._autopilot = autopilot
        self._endpoints = endpoints
        self._faults = faults
        self._mavlink1 = mavlink1
        self._peers: dict[tuple[int, Peer], _Peer] = {}
        self._was_up = True

    def exchange(self, now_s: float) -> None:
        """Receive and send whatever there is, and return at once."""
        pausing = self._faults.is_active(FaultKind.PAUSE, now_s)
        holding = self._faults.is_active(FaultKind.BURST, now_s)
        if self._was_up and not self._autopilot.link_is_up:
            for endpoint in self._endpoints:
                endpoint.close_peers()
        self._was_up = self._autopilot.link_is_up
        for number, endpoint in enumerate(self._endpoints):
            joined, gone, received = endpoint.poll()
            for peer in joined:
                self._join(number, peer)
            for peer, data in received:
                self._peers[number, peer].held_in.append(data)
            for peer in gone:
                self._autopilot.close_channel(self._peers.pop((number, peer)).channel)
            if not self._was_up:
                # A port that is closed during a reboot refuses; ours accepts and hangs up.
                endpoint.close_peers()
        for (number, peer), state in self._peers.items():
            self._receive(state, pausing, holding)
            self._send(self._endpoints[number], peer, state, pausing, holding)

    def close(self) -> None:
        """Close all endpoints."""
        for endpoint in self._endpoints:
            endpoint.close()

    def _join(self, number: int, peer: Peer) -> None:
        codec = mavlink.MAVLink(
            None, srcSystem=self._autopilot.controller.system_id, srcComponent=COMPONENT_ID
        )
        codec.robust_parsing = True
        self._peers[number, peer] = _Peer(self._autopilot.open_channel(), codec)

    def _receive(self, state: _Peer, pausing: bool, holding: bool) -> None:
        if holding:
            return
        held, state.held_in = state.held_in, []
        if pausing:
            return
        for data in held:
            for message in state.codec.parse_buffer(data) or []:
                if message.get_type() != "BAD_DATA":
                    self._autopilot.receive(state.channel, message)

    def _send(self, endpoint: Endpoint, peer: Peer, state: _Peer, pausing: bool, holding: bool) -> None:
        own, passed_on = self._autopilot.collect(state.channel)
        packets = [*filter(None, (self._pack(state.codec, message) for message in own)), *passed_on]
        if pausing:
            return
        state.held_out += packets
        if holding:
            return
        packets, state.held_out = state.held_out, []
        for packet in packets:
            endpoint.send(peer, packet)

    def _pack(self, codec: Any, message: Any) -> bytes:
        if self._mavlink1 and message.get_msgId() > MAVLINK1_LARGEST_ID:
            return b""
        packet = bytes(message.pack(codec, force_mavlink1=self._mavlink1))
        codec.seq = (codec.seq + 1) % 256
        return packet
