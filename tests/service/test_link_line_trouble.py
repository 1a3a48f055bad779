"""The link when its line breaks, stalls or is not there; real sockets and ports."""

from __future__ import annotations

import os
import pty
import socket
import struct
import time
from collections.abc import Hashable
from contextlib import closing
from pathlib import Path

import pytest
from link_peers import PATIENCE_S, eventually, holds_a_conversation, link_to, tcp_peer, udp_peer
from link_support import Voice, clear_scan
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from structlog.testing import capture_logs

from service.autopilot.link import AutopilotLink
from service.autopilot.serial_transport import SerialTransport
from service.autopilot.service_state import ServiceState
from service.autopilot.session import LinkSession
from service.autopilot.stalled_write import StalledWrite
from service.clock import ManualClock, MonotonicClock
from service.settings.autopilot import AutopilotSettings


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
