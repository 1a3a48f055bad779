"""Replays that speak to a live autopilot and to a live ground station."""

from __future__ import annotations

from pathlib import Path

import pytest
from program_fakes import free_port, wait_until
from test_link_sockets import udp_peer
from test_publisher import listening
from test_replay import WALL_M, flown, run

from service.publisher.status_wire import StatusSample
from service.publisher.wire import ScanSample
from service.replay import live_outputs
from service.replay.live_outputs import LiveOutputs
from service.replay.open_footage import open_flight
from service.replay.player import play


def test_a_live_autopilot_hears_the_recorded_wall(tmp_path: Path) -> None:
    port = free_port()
    flight = open_flight([flown(tmp_path, pictures=12)], None, [f"autopilot.endpoint=udp:127.0.0.1:{port}"])
    outputs = LiveOutputs(flight.settings, autopilot=True, zenoh=False)
    with udp_peer(port) as peer, outputs:
        for one in play(flight.settings, flight.footage, from_depth=True):
            outputs.show(one.result, one.note.done_ns)
        wait_until(lambda: peer.of("OBSTACLE_DISTANCE"))
        message = peer.of("OBSTACLE_DISTANCE")[0]
    nearest_m = min(message.distances) / 100
    assert nearest_m == pytest.approx(WALL_M, abs=0.3)


def test_a_live_ground_station_sees_the_recorded_scan_and_state(tmp_path: Path) -> None:
    port = free_port()
    flight = open_flight(
        [flown(tmp_path, "vehicle.name=kite")],
        None,
        ["zenoh.enabled=true", f"zenoh.listen=['tcp/127.0.0.1:{port}']"],
    )
    with LiveOutputs(flight.settings, autopilot=False, zenoh=True) as outputs, listening(port) as heard:
        results = list(play(flight.settings, flight.footage, from_depth=True))

        def offered() -> bool:
            outputs.show(results[-1].result, results[-1].note.done_ns)
            return heard.has("scan", "status", "camera")

        wait_until(offered)
        scan = ScanSample.decode(heard.samples["scan"][-1].payload.to_bytes())
        status = StatusSample.decode(heard.samples["status"][-1].payload.to_bytes())
    assert scan.trusted
    assert status.camera == "replay"
    assert status.mode is not None


def test_no_autopilot_to_speak_to_is_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(live_outputs, "_AUTOPILOT_NS", 300_000_000)
    path = flown(tmp_path)
    endpoint = f"udp:127.0.0.1:{free_port()}"
    assert run("replay", path, "--from-depth", "--autopilot", endpoint) == 1
    assert f"no autopilot heard at {endpoint}" in capsys.readouterr().err
