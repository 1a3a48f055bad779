"""Findings as a table for people and as JSON for scripts."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from service.doctor.finding import Finding, Level, has_failure
from service.doctor.observation import Observation, Plan

_STYLES = {Level.OK: "green", Level.NOTE: "cyan", Level.WARNING: "yellow", Level.FAILURE: "bold red"}


def report_json(findings: Sequence[Finding], seen: Observation, plan: Plan) -> str:
    """One JSON object: endpoint, autopilot, version, system_id, mode, armed, latency_s (counted with, or
    null), ok (no failure), findings.
    """
    return json.dumps(
        {
            "endpoint": seen.endpoint,
            "autopilot": seen.autopilot,
            "version": None if seen.version is None else ".".join(map(str, seen.version)),
            "system_id": seen.system_id,
            "mode": seen.mode,
            "armed": seen.armed,
            "latency_s": plan.latency_s,
            "ok": not has_failure(findings),
            "findings": [asdict(finding) for finding in findings],
        }
    )


def report_table(findings: Sequence[Finding]) -> RenderableType:
    """The findings with their fixes, and one line that sums them up."""
    table = Table(box=None, pad_edge=False, show_header=False)
    table.add_column(no_wrap=True)
    table.add_column(no_wrap=True)
    table.add_column(overflow="fold")
    for finding in findings:
        words = Text(finding.text)
        if finding.fix:
            words.append(f"\n-> {finding.fix}", style="bold" if finding.level is Level.FAILURE else "")
        table.add_row(Text(finding.level.value, style=_STYLES[finding.level]), finding.topic, words)
    return Group(table, Text(), summary(findings))


def summary(findings: Sequence[Finding]) -> Text:
    """`2 failures, 1 warning`, or that all is well."""
    counts = Counter(finding.level for finding in findings)
    failures, warnings = counts[Level.FAILURE], counts[Level.WARNING]
    if not failures and not warnings:
        return Text("Nothing found that would keep obstacles from showing or stopping.", style="green")
    parts = [
        f"{count} {word}{'' if count == 1 else 's'}"
        for count, word in ((failures, "failure"), (warnings, "warning"))
        if count
    ]
    return Text(", ".join(parts) + ".", style=_STYLES[Level.FAILURE if failures else Level.WARNING])
