"""The demo in a terminal, live."""

from __future__ import annotations

import math

from rich.console import Group, RenderableType
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from service.clock import Clock
from service.demo.flight import DemoFlight
from service.watch.view import render_board


def render_flight(flight: DemoFlight, clock: Clock) -> RenderableType:
    """Vehicle and service as they are now."""
    parts: list[RenderableType] = [_vehicle_panel(flight)]
    if flight.plan.blind:
        parts.append(Text("flying blind: the service is off", style="bold red"))
    elif flight.observer is not None:
        parts.append(render_board(flight.observer.board, "the service", clock.now_ns()))
    return Group(*parts)


def _vehicle_panel(flight: DemoFlight) -> Panel:
    table = Table.grid(padding=(0, 3))
    table.add_row("phase", flight.phase.value, "scene", flight.plan.scene)
    if flight.autopilot is not None and flight.autopilot.is_running:
        truth = flight.autopilot.truth()
        north, _, down = truth.position_ned_m
        speed = math.hypot(*truth.velocity_ned_mps[:2])
        nearest = "-" if truth.nearest_m is None else f"{truth.nearest_m:.1f} m"
        state = Text("COLLIDED", style="bold red") if truth.collided else Text(truth.mode)
        table.add_row("mode", state, "flown north", f"{north:.1f} m")
        table.add_row("speed", f"{speed:.1f} m/s", "height", f"{-down:.1f} m")
        table.add_row(
            "obstacle messages",
            f"{truth.obstacle_messages} ({truth.obstacle_rate_hz:.1f} Hz)",
            "nearest, as the autopilot has it",
            nearest,
        )
    return Panel(table, title=f"fake {flight.plan.flavor}", title_align="left")
