"""The board as a terminal shows it."""

from __future__ import annotations

import json
from typing import Any

from rich.console import Group, RenderableType
from rich.markup import escape
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from service.freshness import Freshness
from service.publisher.status_wire import ExtraCamera, StatusSample
from service.publisher.wire import ScanSample
from service.watch.board import Board, VehicleView
from uavdepth.scan.obstacle_scan import SectorState

_BLOCKS = " ▁▂▃▄▅▆▇█"
_STATE_STYLES = {"ACTIVE": "green", "STANDBY": "yellow", "BOOT": "yellow", "CRITICAL": "bold red"}
_FRESHNESS_STYLES = {
    Freshness.LIVE: "green",
    Freshness.STALE: "bold yellow",
    Freshness.NO_DATA: "bold red",
}


def render_board(board: Board, places: str, now_ns: int) -> RenderableType:
    """Everything that is known, one panel a vehicle."""
    views = board.vehicles(now_ns)
    parts: list[RenderableType] = [_vehicle_panel(view) for view in views]
    if not views:
        parts.append(Text(f"no vehicle heard at {places} yet", style="yellow"))
    bad = board.bad_samples
    if bad.count:
        parts.append(Text(f"{bad.count} samples not understood: {bad.last}", style="yellow"))
    return Group(*parts)


def board_json(board: Board, now_ns: int) -> str:
    """Everything that is known as one line of JSON."""
    document = {
        "vehicles": {view.name: _vehicle_document(view) for view in board.vehicles(now_ns)},
        "bad_samples": board.bad_samples.count,
    }
    return json.dumps(document)


def _vehicle_document(view: VehicleView) -> dict[str, Any]:
    scan, status = view.scan, view.status
    return {
        "alive": view.alive,
        "freshness": view.freshness.value,
        "age_s": view.age_s,
        "nearest_m": None if scan is None else scan.scan.nearest_m,
        "scan": None if scan is None else scan.model_dump(mode="json"),
        "status": None if status is None else status.model_dump(mode="json"),
        "scans": view.scans,
    }


def _vehicle_panel(view: VehicleView) -> Panel:
    age = "" if view.age_s is None else f" {view.age_s:.1f} s"
    title = Text(view.name, style="bold")
    title.append(f"  {view.freshness.value}{age}", style=_FRESHNESS_STYLES[view.freshness])
    if not view.alive:
        title.append("  session gone", style="bold red")
    rows: list[RenderableType] = []
    if view.scan is not None:
        rows.append(_scan_rows(view.scan))
    rows.append(_status_rows(view.status))
    return Panel(Group(*rows), title=title, title_align="left")


def _scan_rows(sample: ScanSample) -> RenderableType:
    """One column an element that is known, from left to right as the pilot looks."""
    if not sample.trusted:
        return Text(f"NOT TRUSTED: {sample.trouble}", style="bold red")
    scan = sample.scan
    bearing = (scan.bearing_deg + 180) % 360 - 180
    order = [index for index in bearing.argsort() if scan.state[index] != SectorState.UNKNOWN]
    heading, bars = Text("bearing  "), Text("distance ")
    metres, words = Text("metres   "), Text("nearest  ")
    for index in order:
        heading.append(f"{bearing[index]:+5.0f}", style="dim")
        if scan.state[index] == SectorState.CLEAR:
            bars.append("    ·", style="green")
            metres.append("clear"[:5], style="green")
            continue
        distance = float(scan.distance_m[index])
        near = 1 - min(distance / scan.max_distance_m, 1.0)
        style = "bold red" if distance < scan.max_distance_m / 4 else "yellow"
        bars.append("    " + _BLOCKS[1 + round(near * (len(_BLOCKS) - 2))], style=style)
        metres.append(f"{distance:5.1f}", style=style)
    nearest = scan.nearest_m
    if nearest is None:
        words.append(f"nothing within {scan.max_distance_m:g} m of what is seen", style="green")
    else:
        words.append(f"{nearest:.1f} m", style="bold")
    return Group(heading, bars, metres, words)


def _status_rows(status: StatusSample | None) -> RenderableType:
    if status is None:
        return Text("no status", style="yellow")
    table = Table.grid(padding=(0, 2))
    state = Text(status.state, style=_STATE_STYLES.get(status.state, "bold red"))
    if status.trouble:
        state.append(f" ({status.trouble})")
    latency = _latency(status.latency_ms_p50, status.latency_ms_p95)
    scale = "-"
    if status.scale_factor is not None and status.scale_relative_sigma is not None:
        scale = f"{status.scale_factor:.2f} ±{100 * status.scale_relative_sigma:.0f} %"
        if status.scale_sources:
            scale += f" ({', '.join(status.scale_sources)})"
    table.add_row("state", state, "latency p50 / p95", latency)
    table.add_row("rate", f"{status.frames_per_s:.1f}/s", "scale", escape(scale))
    autopilot = "not connected"
    if status.link_connected:
        armed = {True: "armed", False: "disarmed", None: ""}[status.armed]
        autopilot = f"{status.autopilot or '?'} {status.mode or ''} {armed}".strip()
    table.add_row("autopilot", escape(autopilot), "height", _with_unit(status.height_m, "m"))
    messages = str(status.obstacle_messages)
    if status.obstacle_rate_hz is not None:
        messages += f", {status.obstacle_rate_hz:.1f}/s"
    table.add_row("camera", escape(status.camera), "messages", messages)
    for extra in status.extra_cameras:
        table.add_row(f"camera {escape(extra.name)}", _extra_camera(extra), "latency", _latency_of(extra))
    table.add_row(
        "altitude", _with_unit(status.altitude_m, "m"), "speed", _with_unit(status.speed_mps, "m/s")
    )
    if status.cp_delay_s is not None and status.margin_m is not None:
        table.add_row("advised", f"margin {status.margin_m:.1f} m", "CP_DELAY", f"{status.cp_delay_s:.2f} s")
    if status.recording is not None:
        table.add_row(
            "record", "recording" if status.recording else Text("NOT RECORDING", style="bold yellow")
        )
    details = (
        status.camera_detail,
        *(extra.camera_detail for extra in status.extra_cameras),
        status.link_detail,
        status.recording_detail,
        status.scale_suspicion,
    )
    notes = [text for text in details if text]
    return Group(table, *(Text(note, style="yellow") for note in notes))


def _extra_camera(extra: ExtraCamera) -> Text:
    """`delivering, 14.8/s` and, where it is so, why it is missing from the messages."""
    words = Text(f"{extra.camera}, {extra.frames_per_s:.1f}/s")
    if extra.trouble is not None:
        words.append(f", OFF: {extra.trouble}", style="bold yellow")
    if extra.losses:
        words.append(f", lost {extra.losses} times" if extra.losses > 1 else ", lost once", style="yellow")
    return words


def _latency_of(extra: ExtraCamera) -> str:
    age = "" if extra.age_s is None else f", picture {extra.age_s:.1f} s old"
    return _latency(extra.latency_ms_p50, extra.latency_ms_p95) + age


def _latency(p50_ms: float | None, p95_ms: float | None) -> str:
    return "-" if p50_ms is None or p95_ms is None else f"{p50_ms:.0f} / {p95_ms:.0f} ms"


def _with_unit(value: float | None, unit: str) -> str:
    return "-" if value is None else f"{value:.1f} {unit}"
