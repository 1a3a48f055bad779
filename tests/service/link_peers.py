"""Autopilots at the other end of real sockets and ports of the loopback."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager, suppress

import pytest
from link_support import Voice, clear_scan
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from service.autopilot.link import AutopilotLink
from service.autopilot.service_state import ServiceState
from service.clock import MonotonicClock
from service.settings.autopilot import AutopilotSettings

PATIENCE_S = 20.0
"""How long a test waits for what must come; nothing is asserted of how soon it does."""


def eventually(condition: Callable[[], object]) -> None:
    end_s = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < end_s, "waited in vain"
        time.sleep(0.01)


@contextmanager
def link_to(endpoint: str) -> Iterator[AutopilotLink]:
    link = AutopilotLink(AutopilotSettings(endpoint=endpoint), MonotonicClock())
    link.start()
    try:
        yield link
    finally:
        link.close()


class Peer:
    """An autopilot that streams ATTITUDE and answers TIMESYNC, over whatever `read` and `write` are."""

    def __init__(
        self, read: Callable[[], bytes], write: Callable[[bytes], object], system_id: int = 3
    ) -> None:
        self._read, self._write = read, write
        self._voice = Voice(system_id)
        self._parser = mavlink.MAVLink(None)
        self._parser.robust_parsing = True
        self.heard: list[mavlink.MAVLink_message] = []
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def of(self, name: str) -> list[mavlink.MAVLink_message]:
        return [message for message in list(self.heard) if message.get_type() == name]

    def close(self) -> None:
        self._stop.set()
        self._thread.join()

    def _run(self) -> None:
        self._start_s, turn = time.monotonic(), 0
        while not self._stop.is_set():
            if turn % 500 == 0:
                self._say(self._voice.heartbeat())
            if turn % 10 == 0:
                self._say(self._voice.attitude(self._boot_ms(), roll=0.25))
            with suppress(OSError):
                self._listen(self._read())
            turn += 1
            self._stop.wait(0.002)

    def _listen(self, data: bytes) -> None:
        for message in self._parser.parse_buffer(data) or []:
            self.heard.append(message)
            if message.get_type() == "TIMESYNC" and message.tc1 == 0:
                answer = mavlink.MAVLink_timesync_message(self._boot_ms() * 1_000_000, message.ts1)
                self._say(self._voice.pack(answer))

    def _say(self, frame: bytes) -> None:
        with suppress(OSError):  # the link may be closed by now
            self._write(frame)

    def _boot_ms(self) -> int:
        return round((time.monotonic() - self._start_s) * 1000) + 5000


def quiet_read(sock: socket.socket) -> Callable[[], bytes]:
    def read() -> bytes:
        try:
            return sock.recv(65536)
        except BlockingIOError:
            return b""

    return read


@contextmanager
def udp_peer(port: int) -> Iterator[Peer]:
    with closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as sock:
        sock.connect(("127.0.0.1", port))
        sock.setblocking(False)
        peer = Peer(quiet_read(sock), sock.send)
        try:
            yield peer
        finally:
            peer.close()


@contextmanager
def tcp_peer(server: socket.socket) -> Iterator[Peer]:
    connection, _ = server.accept()
    with closing(connection):
        connection.setblocking(False)
        peer = Peer(quiet_read(connection), connection.send)
        try:
            yield peer
        finally:
            peer.close()


def holds_a_conversation(link: AutopilotLink, peer: Peer) -> None:
    """Everything that a flight needs, once through."""
    link.set_state(ServiceState.ACTIVE)
    link.say(6, "hello")
    eventually(lambda: link.status().connected)
    eventually(lambda: link.newest_pose().attitude)
    attitude = link.newest_pose().attitude
    assert attitude is not None
    assert attitude.roll_rad == pytest.approx(0.25)
    eventually(lambda: link.status().clock_synced)
    eventually(lambda: link.send_obstacles(clear_scan(), time.monotonic_ns()))
    eventually(lambda: peer.of("OBSTACLE_DISTANCE"))
    eventually(lambda: peer.of("STATUSTEXT"))
    eventually(lambda: {m.param1 for m in peer.of("COMMAND_LONG")} >= {30.0, 32.0, 132.0})
    eventually(lambda: [m for m in peer.of("HEARTBEAT") if m.system_status == mavlink.MAV_STATE_ACTIVE])
    obstacles = peer.of("OBSTACLE_DISTANCE")[0]
    assert (obstacles.get_srcSystem(), obstacles.get_srcComponent()) == (3, 196)
    assert obstacles.time_usec > 0
    assert link.status().sent_obstacles >= 1
    assert link.status().system_id == 3
