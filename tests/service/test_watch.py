"""`uavdepth watch`: fresh, stale and missing are told apart, garbage is counted."""

from __future__ import annotations

import json

import numpy as np
import pytest
from program_fakes import free_port, wait_until
from rich.console import Console

from service.clock import MonotonicClock
from service.freshness import Freshness
from service.publisher.session import open_session
from service.publisher.status_wire import StatusSample
from service.publisher.wire import MAX_SAMPLE_BYTES, ScanSample
from service.watch.board import Board
from service.watch.listener import Listener
from service.watch.view import board_json, render_board
from uavdepth.scan.obstacle_scan import ObstacleScan, SectorState, sector_bearings_deg

SECOND = 1_000_000_000


def scan_bytes(distance_m: float | None = 6.0, trouble: str | None = None) -> bytes:
    state = np.full(72, SectorState.UNKNOWN, np.uint8)
    distance = np.full(72, np.nan, np.float32)
    if trouble is None:
        state[25:38] = SectorState.CLEAR
        if distance_m is not None:
            state[31], distance[31] = SectorState.OBSTACLE, distance_m
    scan = ObstacleScan(distance, state, sector_bearings_deg(), 0.2, 20.0)
    return ScanSample.of(scan, index=0, captured_ns=0, age_ms=50.0, trouble=trouble).encode()


def status_bytes(**changes: object) -> bytes:
    values: dict[str, object] = {
        "vehicle": "kite",
        "state": "ACTIVE",
        "uptime_s": 9.0,
        "frames_per_s": 14.8,
        "obstacle_messages": 130,
        "latency_ms_p50": 61.0,
        "latency_ms_p95": 88.0,
        "scale_factor": 1.25,
        "scale_relative_sigma": 0.05,
        "height_m": 3.25,
        "mode": "LOITER",
        "armed": True,
        "autopilot": "ardupilot",
        "camera": "delivering",
        "link_connected": True,
        "memory_mib": 150.0,
    }
    values.update(changes)
    return StatusSample.model_validate(values).encode()


def text_of(board: Board, now_ns: int) -> str:
    console = Console(width=160, record=True, file=None, quiet=False, force_terminal=False)
    with console.capture() as capture:
        console.print(render_board(board, "tcp/127.0.0.1:7447", now_ns))
    return capture.get()


@pytest.mark.parametrize(
    ("age_s", "freshness", "shown"),
    [(0.9, Freshness.LIVE, True), (1.1, Freshness.STALE, True), (3.1, Freshness.NO_DATA, False)],
)
def test_data_age_by_the_viewers_own_clock(age_s: float, freshness: Freshness, shown: bool) -> None:
    board = Board()
    board.hear("uavdepth/kite/scan", scan_bytes(), 0)
    board.hear("uavdepth/kite/status", status_bytes(), 0)
    (view,) = board.vehicles(round(age_s * SECOND))
    assert view.freshness is freshness
    assert (view.scan is not None) is shown
    text = text_of(board, round(age_s * SECOND))
    assert freshness.value in text
    assert ("6.0 m" in text) is shown


def test_a_living_session_is_no_sign_of_fresh_data() -> None:
    board = Board()
    board.hear_alive("uavdepth/kite/alive", True)
    (view,) = board.vehicles(0)
    assert view.alive
    assert view.freshness is Freshness.NO_DATA
    assert "no data" in text_of(board, 0)
    board.hear_alive("uavdepth/kite/alive", False)
    assert "session gone" in text_of(board, 0)


def test_the_nearest_obstacle_and_the_status_are_shown() -> None:
    board = Board()
    board.hear("uavdepth/kite/scan", scan_bytes(6.0), 0)
    board.hear("uavdepth/kite/status", status_bytes(), 0)
    text = text_of(board, 0)
    for words in (
        "kite",
        "6.0 m",
        "+0",
        "clear",
        "ACTIVE",
        "61 / 88 ms",
        "1.25 ±5 %",
        "LOITER",
        "armed",
        "3.2 m",
    ):
        assert words in text


def test_what_the_vehicle_advises_and_records_is_shown() -> None:
    board = Board()
    status = status_bytes(
        altitude_m=12.3,
        speed_mps=4.5,
        cp_delay_s=0.42,
        margin_m=2.6,
        recording=False,
        recording_detail="disk full",
        scale_sources=["ground", "points"],
    )
    board.hear("uavdepth/kite/status", status, 0)
    text = text_of(board, 0)
    for words in (
        "12.3 m",
        "4.5 m/s",
        "0.42 s",
        "margin 2.6 m",
        "NOT RECORDING",
        "disk full",
        "ground, points",
    ):
        assert words in text


def test_further_cameras_are_shown_each_with_its_trouble() -> None:
    board = Board()
    well = {"name": "left", "used": True, "camera": "delivering", "frames_per_s": 14.6, "age_s": 0.07}
    well |= {"latency_ms_p50": 92.0, "latency_ms_p95": 121.0}
    dead = {"name": "right", "used": False, "camera": "lost", "frames_per_s": 0.0, "losses": 1}
    dead |= {"trouble": "no pictures from the camera", "camera_detail": "camera 2: unplugged"}
    board.hear("uavdepth/kite/status", status_bytes(extra_cameras=[well, dead]), 0)
    text = text_of(board, 0)
    for words in (
        "camera left",
        "delivering, 14.6/s",
        "92 / 121 ms, picture 0.1 s old",
        "lost, 0.0/s, OFF: no pictures from the camera, lost once",
        "camera 2: unplugged",
    ):
        assert words in text


def test_nothing_near_and_not_trusted_read_differently() -> None:
    board = Board()
    board.hear("uavdepth/kite/scan", scan_bytes(None), 0)
    assert "nothing within 20 m" in text_of(board, 0)
    board.hear("uavdepth/kite/scan", scan_bytes(trouble="no height above ground"), 0)
    text = text_of(board, 0)
    assert "NOT TRUSTED: no height above ground" in text
    assert "nothing within" not in text


@pytest.mark.parametrize(
    ("key", "payload"),
    [
        ("uavdepth/kite/scan", b"\x00garbage"),
        ("uavdepth/kite/scan", b"{}"),
        ("uavdepth/kite/status", b"[1,2]"),
        ("uavdepth/kite/depth", b"x"),
        ("other/kite/scan", scan_bytes()),
    ],
)
def test_garbage_is_counted_and_leaves_what_is_known(key: str, payload: bytes) -> None:
    board = Board()
    board.hear("uavdepth/kite/scan", scan_bytes(), 0)
    board.hear(key, payload, 1)
    assert board.bad_samples.count == 1
    assert board.bad_samples.last
    (view,) = board.vehicles(2)
    assert view.scans == 1
    assert view.freshness is Freshness.LIVE


def test_invented_vehicles_do_not_fill_the_memory() -> None:
    board = Board()
    for number in range(1000):
        board.hear(f"uavdepth/v{number}/scan", scan_bytes(), 0)
    assert len(board.vehicles(0)) == 200
    assert board.bad_samples.count == 800


def test_nothing_from_the_network_tells_the_terminal_what_to_do() -> None:
    board = Board()
    status = json.loads(status_bytes()) | {
        "trouble": "\x1b[2J\x9b2Jcleared",
        "camera_detail": "\x1b]0;title\x07",
    }
    board.hear("uavdepth/kite/status", json.dumps(status).encode(), 0)
    board.hear("uavdepth/\x1b[2Jhawk/status", status_bytes(), 0)
    board.hear_alive("uavdepth/\x1b[2Jowl/alive", True)
    text = text_of(board, 0)
    assert "cleared" in text
    assert not {"\x1b", "\x9b", "\x07"} & set(text)
    assert [view.name for view in board.vehicles(0)] == ["kite"]


def test_markup_from_the_network_is_shown_as_text() -> None:
    board = Board()
    board.hear(
        "uavdepth/kite/status", status_bytes(mode="[bold]x[/nope]", camera="[red]", link_detail="[/]"), 0
    )
    text = text_of(board, 0)
    assert "[bold]x[/nope]" in text
    assert "[/]" in text


def test_json_has_the_same_facts() -> None:
    board = Board()
    board.hear("uavdepth/kite/scan", scan_bytes(6.0), 0)
    board.hear("uavdepth/kite/status", status_bytes(), 0)
    document = json.loads(board_json(board, SECOND // 2))
    kite = document["vehicles"]["kite"]
    assert kite["nearest_m"] == pytest.approx(6.0)
    assert kite["freshness"] == "live"
    assert kite["status"]["frames_per_s"] == 14.8
    assert document["bad_samples"] == 0


def test_a_vehicle_is_heard_over_the_loopback_also_if_it_comes_later() -> None:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    board = Board()
    with Listener([endpoint], board, MonotonicClock()), open_session([endpoint], []) as vehicle:
        token = vehicle.liveliness().declare_token("uavdepth/kite/alive")

        def heard() -> bool:
            vehicle.put("uavdepth/kite/scan", scan_bytes())
            vehicle.put("uavdepth/kite/status", status_bytes())
            vehicle.put("uavdepth/kite/scan", b"garbage")
            views = board.vehicles(MonotonicClock().now_ns())
            return (
                bool(views) and views[0].alive and views[0].scan is not None and views[0].status is not None
            )

        wait_until(heard)
        wait_until(lambda: board.bad_samples.count > 0)
        vehicle.put("uavdepth/kite/scan", bytes(MAX_SAMPLE_BYTES + 1))
        wait_until(lambda: "bytes: at most" in board.bad_samples.last)
        token.undeclare()
