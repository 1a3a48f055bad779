"""`uavdepth router`, and the slow radio of the stream benchmark."""

from __future__ import annotations

import signal
import socket
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from program_fakes import free_port, wait_until

from service.benchmark.stream_link import LinkSettings, SlowLink
from service.errors import ConfigError, PublisherError
from service.publisher import keys
from service.publisher.session import Role, open_session
from service.router_command import router, router_settings
from service.security.fleet import FleetFolder, Member
from service.security.options import load_zenoh_settings


@pytest.fixture
def interrupt(monkeypatch: pytest.MonkeyPatch) -> Callable[[], None]:
    """Ends the router as SIGINT would."""
    handlers: list[Any] = []
    monkeypatch.setattr(signal, "signal", lambda _number, handler: handlers.append(handler))

    def end() -> None:
        wait_until(lambda: bool(handlers))
        handlers[0](signal.SIGINT, None)

    return end


def test_a_fleets_own_files_bring_vehicle_router_and_viewer_together(
    tmp_path: Path, interrupt: Callable[[], None]
) -> None:
    members = (Member("hub", "router", ("127.0.0.1",)), Member("kite", "vehicle"), Member("desk", "viewer"))
    FleetFolder(tmp_path / "fleet", members, 10, passwords=True, target=None).make(force=False)
    endpoint = f"tls/127.0.0.1:{free_port()}"
    files = {name: tmp_path / "fleet" / name / "zenoh.toml" for name in ("hub", "kite", "desk")}
    running = threading.Thread(target=router, args=(files["hub"], [endpoint], None))
    running.start()
    try:
        kite, desk = (load_zenoh_settings(files[name]) for name in ("kite", "desk"))
        with (
            open_session([], [endpoint], kite.security) as vehicle,
            open_session([], [endpoint], desk.security, Role.STATION) as station,
        ):
            heard: list[str] = []
            station.declare_subscriber(keys.key("*", keys.SCAN), lambda s: heard.append(str(s.key_expr)))

            def put() -> bool:
                vehicle.put(keys.key("kite", keys.SCAN), b"x")
                return bool(heard)

            wait_until(put)
            assert set(heard) == {"uavdepth/kite/scan"}
    finally:
        interrupt()
        running.join()


def test_two_routers_and_a_vehicle_with_an_address_of_its_own_hand_on_both_ways(tmp_path: Path) -> None:
    members = (
        Member("hub", "router", ("127.0.0.1",)),
        Member("far", "router", ("127.0.0.1",)),
        Member("kite", "vehicle", ("127.0.0.1",)),
        Member("desk", "viewer"),
    )
    FleetFolder(tmp_path / "fleet", members, 10, passwords=True, target=None).make(force=False)
    hub, far, kite, desk = (
        load_zenoh_settings(tmp_path / "fleet" / member.name / "zenoh.toml").security for member in members
    )
    near_end, far_end = (f"tls/127.0.0.1:{free_port()}" for _ in range(2))
    with (
        open_session([near_end], [], hub, Role.STATION),
        open_session([far_end], [near_end], far, Role.STATION),
        open_session([], [far_end], kite) as vehicle,
        open_session([], [near_end], desk, Role.STATION) as station,
    ):
        scans: list[str] = []
        reports: list[str] = []
        station.declare_subscriber(keys.key("*", keys.SCAN), lambda s: scans.append(str(s.key_expr)))
        received = keys.key("kite", keys.RECEIVED)
        vehicle.declare_subscriber(received, lambda s: reports.append(str(s.key_expr)))

        def speak() -> bool:
            vehicle.put(keys.key("kite", keys.SCAN), b"x")
            station.put(received, b"x")
            return bool(scans) and bool(reports)

        wait_until(speak)
        assert set(scans) == {keys.key("kite", keys.SCAN)}
        assert set(reports) == {received}


def test_a_port_in_use_ends_the_router_with_its_name(interrupt: Callable[[], None]) -> None:
    with socket.create_server(("127.0.0.1", 0)) as blocker:
        endpoint = f"tcp/127.0.0.1:{blocker.getsockname()[1]}"
        with pytest.raises(PublisherError, match=f"{endpoint} is in use by another program"):
            router(None, [endpoint], None)


def test_a_router_with_nothing_to_listen_on_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "zenoh.toml"
    file.write_text('[zenoh]\nlisten = []\nconnect = ["tcp/127.0.0.1:7447"]\n')
    with pytest.raises(ConfigError, match="needs an endpoint to listen on"):
        router_settings(file, None, None)
    with pytest.raises(ConfigError, match="is no endpoint"):
        router_settings(None, ["127.0.0.1"], None)


def test_the_slow_radio_loses_and_changes_nothing() -> None:
    data = bytes(range(256)) * 200
    with (
        socket.create_server(("127.0.0.1", 0)) as vehicle,
        SlowLink(vehicle.getsockname()[1], LinkSettings(8e6, 8_192)) as radio,
        socket.create_connection(("127.0.0.1", radio.port)) as ground,
    ):
        sender, _ = vehicle.accept()
        threading.Thread(target=_send_all, args=(sender, data)).start()
        received = b""
        while part := ground.recv(65_536):
            received += part
        assert received == data
        assert radio.carried_bytes == len(data)
        assert radio.largest_queue_s <= (8_192 + 1_400) / 1e6 + 1e-3


def _send_all(sender: socket.socket, data: bytes) -> None:
    with sender:
        sender.sendall(data)
