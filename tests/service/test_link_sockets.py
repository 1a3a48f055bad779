"""The link over real sockets and ports, against a minimal peer on the loopback."""

from __future__ import annotations

import os
import pty
import socket
import struct
import threading
import time
from collections.abc import Callable, Hashable, Iterator
from contextlib import closing, contextmanager, suppress
from pathlib import Path

import pytest
from link_support import Voice, clear_scan
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from structlog.testing import capture_logs

from service.autopilot.link import AutopilotLink
from service.autopilot.serial_transport import SerialTransport
from service.autopilot.service_state import ServiceState
from service.autopilot.session import LinkSession
from service.autopilot.stalled_write import StalledWrite
from service.clock import ManualClock, MonotonicClock
from service.errors import LinkError
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


@pytest.fixture
def server() -> Iterator[socket.socket]:
    with closing(socket.create_server(("127.0.0.1", 0))) as listening:
        listening.settimeout(PATIENCE_S)
        yield listening


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


def test_a_conversation_over_a_udp_port_that_listens() -> None:
    with link_to("udp:127.0.0.1:0") as link:
        assert link.listen_port
        with udp_peer(link.listen_port) as peer:
            holds_a_conversation(link, peer)


def test_a_conversation_over_udp_that_sends() -> None:
    with closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as sock:
        sock.bind(("127.0.0.1", 0))
        sock.settimeout(PATIENCE_S)
        with link_to(f"udpout:127.0.0.1:{sock.getsockname()[1]}") as link:
            _, address = sock.recvfrom(1000)  # the link speaks first
            sock.connect(address)
            sock.setblocking(False)
            peer = Peer(quiet_read(sock), sock.send)
            try:
                holds_a_conversation(link, peer)
            finally:
                peer.close()


def test_a_conversation_over_tcp(server: socket.socket) -> None:
    with link_to(f"tcp:127.0.0.1:{server.getsockname()[1]}") as link, tcp_peer(server) as peer:
        holds_a_conversation(link, peer)


def test_a_conversation_over_a_serial_port() -> None:
    master, slave = pty.openpty()
    os.set_blocking(master, False)

    def read() -> bytes:
        try:
            return os.read(master, 65536)
        except BlockingIOError:
            return b""

    try:
        with link_to(f"serial:{os.ttyname(slave)}:921600") as link:
            peer = Peer(read, lambda data: os.write(master, data))
            try:
                holds_a_conversation(link, peer)
            finally:
                peer.close()
    finally:
        os.close(master)
        os.close(slave)


def test_a_tcp_connection_that_breaks_is_opened_again(server: socket.socket) -> None:
    with link_to(f"tcp:127.0.0.1:{server.getsockname()[1]}") as link:
        with tcp_peer(server):
            eventually(lambda: link.status().connected)
        eventually(lambda: link.status().line_losses == 1)
        with tcp_peer(server) as peer:
            eventually(lambda: link.status().connected)
            eventually(lambda: {m.param1 for m in peer.of("COMMAND_LONG")} >= {30.0, 32.0, 132.0})
            assert link.status().problem is None


def test_a_refused_connection_is_tried_until_it_opens_and_told_once() -> None:
    with closing(socket.socket()) as reserved:
        reserved.bind(("127.0.0.1", 0))  # bound, not listening: connections are refused
        with capture_logs() as logs, link_to(f"tcp:127.0.0.1:{reserved.getsockname()[1]}") as link:
            eventually(lambda: link.status().problem)
            problem = link.status().problem
            assert problem is not None
            assert f"tcp:127.0.0.1:{reserved.getsockname()[1]}" in problem
            assert "refused" in problem
            assert not link.status().line_open
            assert not link.send_obstacles(clear_scan(), time.monotonic_ns())
            reserved.listen()
            reserved.settimeout(PATIENCE_S)
            with tcp_peer(reserved):
                eventually(lambda: link.status().connected)
        assert len([entry for entry in logs if "refused" in entry["event"]]) == 1


def test_a_missing_serial_device_is_tried_again_and_told(tmp_path: Path) -> None:
    with link_to(f"serial:{tmp_path / 'ttyNone'}:57600") as link:
        eventually(lambda: link.status().problem)
        problem = link.status().problem
        assert problem is not None
        assert "ttyNone" in problem
        assert "No such file" in problem


def test_a_port_in_use_stops_the_start() -> None:
    with closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as other:
        other.bind(("127.0.0.1", 0))
        endpoint = f"udp:127.0.0.1:{other.getsockname()[1]}"
        link = AutopilotLink(AutopilotSettings(endpoint=endpoint), MonotonicClock())
        with pytest.raises(LinkError, match=rf"cannot listen on {endpoint}: .*in use"):
            link.start()
        link.close()


def test_a_malformed_endpoint_stops_the_start() -> None:
    link = AutopilotLink(AutopilotSettings.model_construct(endpoint="com3"), MonotonicClock())
    with pytest.raises(LinkError, match="'com3' is not understood"):
        link.start()
    link.close()


def test_a_link_starts_once_and_closes_twice() -> None:
    with link_to("udp:127.0.0.1:0") as link:
        with pytest.raises(LinkError, match="already"):
            link.start()
        link.close()
    assert not [thread for thread in threading.enumerate() if thread.name == "autopilot-link"]


def test_the_last_words_before_closing_still_leave() -> None:
    with link_to("udp:127.0.0.1:0") as link:
        assert link.listen_port
        with udp_peer(link.listen_port) as peer:
            eventually(lambda: link.status().connected)
            link.say(4, "stopped")
            link.close()
            eventually(lambda: [m.text for m in peer.of("STATUSTEXT")] == ["stopped"])


def test_garbage_from_the_network_does_no_harm() -> None:
    with (
        link_to("udp:127.0.0.1:0") as link,
        closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as noise,
    ):
        assert link.listen_port
        for size in (0, 1, 3, 280, 9000):
            noise.sendto(b"\xfd" * size, ("127.0.0.1", link.listen_port))
            noise.sendto(os.urandom(size), ("127.0.0.1", link.listen_port))
        with udp_peer(link.listen_port):
            eventually(lambda: link.status().connected)


def test_a_fault_of_the_service_itself_does_not_end_the_link(monkeypatch: pytest.MonkeyPatch) -> None:
    whole, faults = LinkSession.receive, [ZeroDivisionError("a fault"), struct.error("another")]

    def faulty(session: LinkSession, data: bytes, arrival_ns: int, source: Hashable = None) -> None:
        if faults:
            raise faults.pop()
        whole(session, data, arrival_ns, source)

    monkeypatch.setattr(LinkSession, "receive", faulty)
    with closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as unused:
        unused.bind(("127.0.0.1", 0))
        port = unused.getsockname()[1]
    with capture_logs() as logs, link_to(f"udp:127.0.0.1:{port}") as link, udp_peer(port):
        eventually(lambda: link.status().connected)
        eventually(lambda: link.send_obstacles(clear_scan(), time.monotonic_ns()))
    assert not faults
    assert [entry["event"] for entry in logs if entry["log_level"] == "error"] == [
        "the autopilot link broke and begins anew"
    ] * 2


def test_a_recorder_that_breaks_does_not_break_the_line() -> None:
    heard: list[bool] = []

    def broken(data: bytes, at_ns: int, outgoing: bool, whose: Hashable) -> None:
        heard.append(outgoing)
        raise RuntimeError("no more room")

    link = AutopilotLink(AutopilotSettings(endpoint="udp:127.0.0.1:0"), MonotonicClock(), broken)
    link.start()
    try:
        assert link.listen_port
        with udp_peer(link.listen_port) as peer:
            holds_a_conversation(link, peer)
    finally:
        link.close()
    assert heard == [False] or heard == [True]
    assert link.status().line_losses == 0


def test_a_peer_that_reads_nothing_does_not_hold_up_the_sender(server: socket.socket) -> None:
    """The line fills up; scans are refused rather than queued, every call returns, the line is given up."""
    server.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 2048)
    settings = AutopilotSettings(endpoint=f"tcp:127.0.0.1:{server.getsockname()[1]}", obstacle_rate_hz=30.0)
    link = AutopilotLink(settings, MonotonicClock())
    link.start()
    try:
        connection, _ = server.accept()
        voice, boot_ms = Voice(), 0
        with closing(connection):

            def jammed() -> bool:
                nonlocal boot_ms
                boot_ms += 20
                connection.send(voice.heartbeat() + voice.attitude(boot_ms))
                for _ in range(50):
                    link.set_state(ServiceState.ACTIVE if boot_ms % 40 else ServiceState.STANDBY)
                    link.send_obstacles(clear_scan(), time.monotonic_ns())
                # TIMESYNC requests of the peer make the link answer: they fill the line quickly
                connection.send(
                    b"".join(voice.pack(mavlink.MAVLink_timesync_message(0, n)) for n in range(40))
                )
                status = link.status()
                return status.refused_obstacles.get("congested", 0) > 0 or status.line_losses > 0

            eventually(jammed)
    finally:
        link.close()


def test_a_stalled_write_keeps_frames_whole_and_gives_up_after_three_seconds() -> None:
    clock, taken, room = ManualClock(), bytearray(), 5

    def write(data: bytes) -> int:
        nonlocal room
        if not room:
            raise BlockingIOError
        count = min(room, len(data))
        taken.extend(data[:count])
        room -= count
        return count

    out = StalledWrite(write, clock)
    out.push(b"abcdefgh")
    assert (bytes(taken), len(out)) == (b"abcde", 3)
    clock.advance_s(2.9)
    out.push(b"ij")
    room = 4
    out.push()
    assert bytes(taken) == b"abcdefghi"
    clock.advance_s(2.9)
    out.push()
    clock.advance_s(0.2)
    with pytest.raises(TimeoutError, match="3 s"):
        out.push()


def test_a_full_serial_port_does_not_block() -> None:
    master, slave = pty.openpty()
    try:
        transport = SerialTransport(os.ttyname(slave), 115200, ManualClock())
        for _ in range(200):
            transport.send(b"x" * 1000, None)
        assert transport.pending_bytes > 0
        transport.close()
    finally:
        os.close(master)
        os.close(slave)
