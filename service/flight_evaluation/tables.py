"""An evaluation as tables in a terminal."""

from __future__ import annotations

from typing import Any

from rich.console import Console, Group, RenderableType
from rich.table import Table
from rich.text import Text

_LEAST_COLUMNS = 180
"""What the tables need."""


def render_report(result: dict[str, Any]) -> RenderableType:
    """The tables of `report.report`'s result."""
    heading = (
        f"{result['model']}, {result['machine']}, {result['date']}; pictures {result['picture']}, "
        f"{result['frames_per_s']:g} a second, latency {result['latency_ms']} ms; {result['seeds']} worlds"
    )
    parts: list[RenderableType] = [Text(heading)]
    rows = {**result["scenes"], "all": result["all"]}
    kinds = {figures["depth"] for figures in rows.values()}
    if any("with_true_depth" in figures for figures in rows.values()):
        parts.append(_table("true depth", {n: figures["with_true_depth"] for n, figures in rows.items()}))
    parts.append(_table(f"{kinds.pop()} depth", rows))
    return Group(*parts)


def print_report(result: dict[str, Any]) -> None:
    """Print the tables; where there is less room in long lines, not in cut numbers."""
    Console(width=max(_LEAST_COLUMNS, Console().width)).print(render_report(result))


def _table(title: str, rows: dict[str, dict[str, Any]]) -> Table:
    table = Table(title=title, title_justify="left")
    for name, justify in (
        ("scene", "left"),
        ("pictures (not told)", "right"),
        ("elements", "right"),
        ("missed", "right"),
        ("false", "right"),
        ("unknown", "right"),
        ("nearest error", "right"),
        ("scale error, p95", "right"),
        ("bearing p95", "right"),
        ("approaches stopped", "right"),
        ("stop at", "right"),
        ("corridors passed", "right"),
    ):
        table.add_column(name, justify="left" if justify == "left" else "right")
    for name, figures in rows.items():
        approaches, corridors = figures["approaches"], figures["corridors"]
        stop = figures["stop_distance_m"]
        touched = f", {approaches['touched']} touched" if approaches["touched"] else ""
        table.add_row(
            name,
            f"{figures['pictures']} ({figures['pictures_not_told']})",
            f"{figures['measured']} of {figures['elements']}",
            _percent(figures["missed_rate"]),
            _percent(figures["false_rate"]),
            _percent(figures["unknown_rate"]),
            _percent(figures["nearest_error_median"]),
            f"{_percent(figures['scale_error_median'])}, {_percent(figures['scale_error_p95'])}",
            "-" if figures["bearing_error_p95_deg"] is None else f"{figures['bearing_error_p95_deg']:.1f}°",
            f"{approaches['stopped']} of {approaches['tried']}{touched}",
            "-" if stop is None else f"{stop['least']:.1f} to {stop['most']:.1f} m",
            f"{corridors['passed']} of {corridors['tried']}",
        )
    return table


def _percent(share: float | None) -> str:
    return "-" if share is None else f"{100.0 * share:.2f} %"
