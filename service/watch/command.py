"""`uavdepth watch`."""

from __future__ import annotations

import signal
import threading
from typing import TYPE_CHECKING, Annotated

import typer

from service.security.options import SecurityConfigOption
from service.viewer_endpoints import ConnectOption, viewer_endpoints

if TYPE_CHECKING:
    from service.clock import Clock
    from service.watch.board import Board


def watch(
    config: SecurityConfigOption = None,
    connect: ConnectOption = None,
    once: Annotated[
        bool, typer.Option("--once", help="Wait for data, show it once and end; exit code 1 if none came.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="JSON, one line a look.")] = False,
    timeout_s: Annotated[
        float, typer.Option("--timeout", min=0.1, help="With --once: longest wait in seconds.")
    ] = 10.0,
    period_s: Annotated[float, typer.Option("--period", min=0.05, help="Seconds between two looks.")] = 0.2,
) -> None:
    """Show scan and status of vehicles live."""
    from service.clock import MonotonicClock
    from service.watch.board import Board
    from service.watch.listener import Listener

    zenoh = viewer_endpoints(config, connect or [])
    places = ", ".join((*zenoh.connect, *zenoh.listen))
    board, clock = Board(), MonotonicClock()
    # Set by hand, since a program that a shell starts in the background inherits SIGINT as ignored.
    stop = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda _number, _frame: stop.set())
    with Listener(zenoh.connect, board, clock, zenoh.listen, zenoh.security):
        if once:
            raise typer.Exit(0 if _show_once(board, clock, places, timeout_s, as_json, stop) else 1)
        _show_live(board, clock, places, period_s, as_json, stop)


def _show_once(
    board: Board, clock: Clock, places: str, timeout_s: float, as_json: bool, stop: threading.Event
) -> bool:
    """Show the board as soon as a vehicle has scan and status, or at the time-out; whether one was heard."""
    from service.watch.view import board_json, render_board

    end_ns = clock.now_ns() + round(timeout_s * 1e9)
    while clock.now_ns() < end_ns:
        views = board.vehicles(clock.now_ns())
        if any(view.scan is not None and view.status is not None for view in views):
            break
        if stop.wait(0.05):
            break
    now_ns = clock.now_ns()
    if as_json:
        typer.echo(board_json(board, now_ns))
    else:
        from rich.console import Console

        Console().print(render_board(board, places, now_ns))
    return any(view.scan is not None or view.status is not None for view in board.vehicles(now_ns))


def _show_live(
    board: Board, clock: Clock, places: str, period_s: float, as_json: bool, stop: threading.Event
) -> None:
    from service.watch.view import board_json, render_board

    if as_json:
        while not stop.is_set():
            typer.echo(board_json(board, clock.now_ns()))
            stop.wait(period_s)
        return
    from rich.console import Console
    from rich.live import Live

    with Live(console=Console(), auto_refresh=False, screen=False) as live:
        while not stop.is_set():
            live.update(render_board(board, places, clock.now_ns()), refresh=True)
            stop.wait(period_s)
