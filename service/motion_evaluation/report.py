"""An evaluation as a table for people and as JSON for scripts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from service.motion_evaluation.summary import GroupSummary, Target


def report_json(
    about: Mapping[str, Any],
    groups: Mapping[str, GroupSummary],
    journeys: Mapping[str, GroupSummary],
    targets: Sequence[Target],
) -> dict[str, Any]:
    """One object: what was run, each group, each journey, each target."""
    return {
        **about,
        "groups": {name: each.as_json() for name, each in groups.items()},
        "journeys": {name: each.as_json() for name, each in journeys.items()},
        "targets": [asdict(target) for target in targets],
    }


def report_table(
    groups: Mapping[str, GroupSummary], journeys: Mapping[str, GroupSummary], targets: Sequence[Target]
) -> RenderableType:
    """Points and network, then the scale, then the targets."""
    rows = {**journeys, **groups}
    return Group(_depth_table(rows), Text(), _scale_table(rows), Text(), _target_table(targets))


def _depth_table(rows: Mapping[str, GroupSummary]) -> Table:
    table = _table(
        "points and network", "points", "median", "p95", "bias", "in 1 sigma", "hinted", "unhinted"
    )
    for name, row in rows.items():
        points = row.points
        words = ["-"] * 5
        if points is not None:
            shares = (points.median, points.p95, points.bias, points.within_sigma)
            words = [f"{points.per_picture:.0f}", *(_percent(each) for each in shares)]
        hinted = row.hinted_abs_rel if row.hinted_abs_rel is not None else row.held_out_abs_rel
        table.add_row(name, *words, _ratio(hinted), _ratio(row.unhinted_abs_rel))
    return table


def _scale_table(rows: Mapping[str, GroupSummary]) -> Table:
    table = _table("scale", "trusted", "median", "p95", "bias", "in 2 sigma", "settled", "abs rel")
    for name, row in rows.items():
        for kind, scale in row.scales.items():
            if scale is None:
                table.add_row(f"{name}: {kind}", *["-"] * 7)
                continue
            settled = "never" if scale.converged_s is None else f"{scale.converged_s:.1f} s"
            shares = (scale.trusted, scale.median, scale.p95, scale.bias, scale.within_two_sigma)
            table.add_row(
                f"{name}: {kind}", *(_percent(each) for each in shares), settled, _ratio(scale.abs_rel)
            )
    return table


def _target_table(targets: Sequence[Target]) -> Table:
    table = _table("target", "found", "")
    for target in targets:
        found = "-" if target.found is None else f"{target.found:.3f}"
        table.add_row(target.what, found, Text("met", "green") if target.met else Text("missed", "red"))
    return table


def _table(first: str, *others: str) -> Table:
    table = Table(box=None, pad_edge=False)
    table.add_column(first, overflow="fold")
    for name in others:
        table.add_column(name, justify="right", no_wrap=True)
    return table


def _percent(share: float) -> str:
    return "-" if share != share else f"{100 * share:.1f} %"


def _ratio(value: float | None) -> str:
    return "-" if value is None or value != value else f"{value:.3f}"
