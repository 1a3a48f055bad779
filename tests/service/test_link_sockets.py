"""The link over real sockets and ports, against a minimal peer on the loopback."""

from __future__ import annotations

import os
import pty
import socket
import threading
from contextlib import closing

import pytest
from link_peers import (
    PATIENCE_S,
    Peer,
    eventually,
    holds_a_conversation,
    link_to,
    quiet_read,
    tcp_peer,
    udp_peer,
)

from service.autopilot.link import AutopilotLink
from service.clock import MonotonicClock
from service.errors import LinkError
from service.settings.autopilot import AutopilotSettings


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
