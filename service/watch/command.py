"""`uavdepth watch`."""

from __future__ import annotations

import signal
import threading
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from service.clock import Clock
    from service.watch.board import Board


def watch(
    connect: Annotated[
        str, typer.Option(help="Zenoh endpoint of the vehicle or of a router.")
    ] = "tcp/127.0.0.1:7447",
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
    from service.errors import ConfigError
    from service.settings.zenoh import check_endpoint
    from service.watch.board import Board
    from service.watch.listener import Listener

    try:
        check_endpoint(connect)
    except ValueError as error:
        raise ConfigError(f"--connect: {error}") from error
    board, clock = Board(), MonotonicClock()
    # Set by hand, since a program that a shell starts in the background inherits SIGINT as ignored.
    stop = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda _number, _frame: stop.set())
    with Listener(connect, board, clock):
        if once:
            raise typer.Exit(0 if _show_once(board, clock, connect, timeout_s, as_json, stop) else 1)
        _show_live(board, clock, connect, period_s, as_json, stop)


def _show_once(
    board: Board, clock: Clock, connect: str, timeout_s: float, as_json: bool, stop: threading.Event
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

        Console().print(render_board(board, connect, now_ns))
    return any(view.scan is not None or view.status is not None for view in board.vehicles(now_ns))


def _show_live(
    board: Board, clock: Clock, connect: str, period_s: float, as_json: bool, stop: threading.Event
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
            live.update(render_board(board, connect, clock.now_ns()), refresh=True)
            stop.wait(period_s)
