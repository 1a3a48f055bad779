"""The result of an evaluation as plain values, for files and for model cards."""

from __future__ import annotations

import platform
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from training.evaluation import FrameErrors
from training.evaluation_summary import SourceSummary, elements_json, metrics_json, summarise
from training.metrics import DEPTH_CAP_M, SMALLEST_DEPTH_M, DepthMetrics

SEEN, HELD_OUT = "seen", "held_out"
"""Kinds of scene that training had, with other seeds; and kinds that it never had."""


@dataclass(frozen=True)
class EvaluationReport:
    """Errors of one network.

    Args:
        model, provider, precision: what was measured, what ran it, and in which number format.
        hints: that the network takes.
        data: what it was measured on, as a sentence.
        details: what else tells which frames they were; plain values.
        labels: sources in the order of the tables.
        networks: those of them that are the network.
        parts: names of the groups of frames that are reported together, such as the seen kinds of scene.
        errors: of each frame.
        date: when, ISO 8601.
        note: what a reader must know, or empty.
    """

    model: str
    provider: str
    precision: str
    hints: tuple[str, ...]
    data: str
    details: Mapping[str, Any]
    labels: tuple[str, ...]
    networks: tuple[str, ...]
    parts: Mapping[str, tuple[str, ...]]
    errors: Sequence[FrameErrors]
    date: str
    note: str = ""
    skipped: Sequence[str] = field(default=())

    def of(self, groups: Sequence[str]) -> list[FrameErrors]:
        """Errors of the frames of some groups."""
        return [item for item in self.errors if item.group in groups]

    def summaries(self, errors: Sequence[FrameErrors]) -> list[SourceSummary]:
        """Each source that had an answer to any of the frames."""
        return [row for row in summarise(errors, self.labels) if row.frames]

    def as_json(self) -> dict[str, Any]:
        """Everything but single frames, as plain values."""
        groups = [group for part in self.parts.values() for group in part]
        return {
            "model": self.model,
            "provider": self.provider,
            "precision": self.precision,
            "hints": list(self.hints),
            "machine": machine_text(),
            "date": self.date,
            "data": self.data,
            **self.details,
            "note": self.note,
            "depth_m": [SMALLEST_DEPTH_M, DEPTH_CAP_M],
            "frames_without_truth": [item.name for item in self.errors if not item.sources],
            "skipped": list(self.skipped),
            "overall": self._group(self.errors),
            "parts": {
                name: {"groups": list(part), **self._group(self.of(part))}
                for name, part in self.parts.items()
            },
            "by_group": {group: self._brief(self.of([group])) for group in groups},
            "summary": self.card_summary(),
        }

    def card_summary(self) -> dict[str, Any]:
        """What a model card tells: the network's errors on each part of the data, and the baselines'."""
        summary: dict[str, Any] = {"data": self.data, "date": self.date, "frames": len(self.errors)}
        if self.note:
            summary["note"] = self.note
        for name, part in self.parts.items():
            rows = self.summaries(self.of(part))
            summary[name] = {
                "groups": list(part),
                **{row.label: _card_row(row) for row in rows if row.label in self.networks},
                "baselines_abs_rel": {
                    row.label: {"median_scaled": _abs_rel(row.scaled), "metric": _abs_rel(row.metric)}
                    for row in rows
                    if row.label not in self.networks
                },
            }
        return summary

    def _group(self, errors: Sequence[FrameErrors]) -> dict[str, Any]:
        return {
            "frames": len(errors),
            "mean_points": mean_points(errors),
            "sources": {row.label: row.as_json() for row in self.summaries(errors)},
        }

    def _brief(self, errors: Sequence[FrameErrors]) -> dict[str, Any]:
        return {
            "frames": len(errors),
            "sources": {row.label: _card_row(row) for row in self.summaries(errors)},
        }


def mean_points(errors: Sequence[FrameErrors]) -> dict[str, float]:
    """How many points there were on average, by the number that was asked for."""
    counts = dict.fromkeys(count for item in errors for count in item.points)
    found = {count: [item.points[count] for item in errors if count in item.points] for count in counts}
    return {str(count): round(sum(numbers) / len(numbers), 1) for count, numbers in found.items()}


def machine_text() -> str:
    """The processor's name and the system, for records."""
    return f"{_processor()}, {platform.system()} {platform.machine()}"


def _processor() -> str:
    try:
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    except OSError:
        pass
    return platform.processor() or "unknown processor"


def _card_row(row: SourceSummary) -> dict[str, Any]:
    values: dict[str, Any] = {
        "frames": row.frames,
        "median_scaled": metrics_json(row.scaled),
        "metric": metrics_json(row.metric),
    }
    doubt, elements = row.doubt, row.elements
    if doubt is not None:
        sigma = doubt.as_json()
        values["within_one_sigma"] = sigma["within_one_sigma"]
        values["surest_half_over_all"] = sigma["per_picture"]["surest_half_over_all"]
    if elements is not None:
        values["nearest_obstacle"] = elements_json(elements)
    return values


def _abs_rel(metrics: DepthMetrics | None) -> float | None:
    return None if metrics is None else round(metrics.abs_rel, 4)
