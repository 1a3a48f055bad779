"""The result of an evaluation: as JSON and as tables."""

from __future__ import annotations

import platform
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.table import Table

from training.data.seed_split import SeedSplit
from training.evaluation import FrameErrors, Method, MethodSummary, summarise
from training.metrics import DEPTH_CAP_M, DepthMetrics

_COLUMNS = (
    ("Abs Rel", "abs_rel"),
    ("Sq Rel", "sq_rel"),
    ("RMSE", "rmse"),
    ("RMSE log", "rmse_log"),
    ("<1.25", "below_125"),
    ("<1.25^2", "below_125_2"),
    ("<1.25^3", "below_125_3"),
)


@dataclass(frozen=True)
class EvaluationReport:
    """Errors of one network.

    Args:
        model, provider: what was measured and what ran it.
        split: what the seeds are kept for.
        scenes, seeds, frames_per_seed: which frames.
        errors: of each frame.
        date: when, ISO 8601.
    """

    model: str
    provider: str
    split: SeedSplit
    scenes: tuple[str, ...]
    seeds: tuple[int, ...]
    frames_per_seed: int
    errors: Sequence[FrameErrors]
    date: str

    def of_scene(self, scene: str) -> list[FrameErrors]:
        """Errors of one scene's frames."""
        return [item for item in self.errors if item.scene == scene]

    def as_json(self) -> dict[str, Any]:
        """Everything but single frames, as plain values."""
        return {
            "model": self.model,
            "provider": self.provider,
            "machine": machine_text(),
            "date": self.date,
            "split": self.split.name.lower(),
            "scenes": list(self.scenes),
            "seeds": list(self.seeds),
            "frames_per_seed": self.frames_per_seed,
            "depth_cap_m": DEPTH_CAP_M,
            "overall": _group(self.errors),
            "by_scene": {scene: _group(self.of_scene(scene)) for scene in self.scenes},
            "summary": self._summary(),
        }

    def _summary(self) -> dict[str, Any]:
        """What a model card tells."""
        rows = {row.method: row for row in summarise(self.errors)}
        network, ground, there = (
            rows[method] for method in (Method.NETWORK, Method.GROUND_SCALED, Method.NETWORK_THERE)
        )
        return {
            "data": (
                f"rendered frames of {self.split.name.lower()} seeds {_ranges(self.seeds)} of "
                f"{', '.join(self.scenes)}, depth below {DEPTH_CAP_M:g} m"
            ),
            "date": self.date,
            "frames": network.frames,
            "median_scaled": _numbers(network.scaled),
            "unscaled": _numbers(network.unscaled),
            "scaled_by_ground": _numbers(ground.unscaled),
            "frames_scaled_by_ground": ground.frames,
            "unscaled_on_those_frames": _numbers(there.unscaled),
            "median_scaled_constant_depth_abs_rel": _abs_rel(rows[Method.CONSTANT].scaled),
            "median_scaled_flat_ground_abs_rel": _abs_rel(rows[Method.FLAT_GROUND].scaled),
        }

    def tables(self) -> list[Table]:
        """One table for each scene and one for all, median-scaled and unscaled."""
        groups = [(scene, self.of_scene(scene)) for scene in self.scenes]
        if len(groups) > 1:
            groups.append(("all", list(self.errors)))
        return [_table(name, errors) for name, errors in groups]


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


def _group(errors: Sequence[FrameErrors]) -> dict[str, Any]:
    methods = {
        row.method.name.lower(): {
            "frames": row.frames,
            "median_scaled": _numbers(row.scaled),
            "unscaled": _numbers(row.unscaled),
        }
        for row in summarise(errors)
    }
    return {
        "frames": len(errors),
        "methods": methods,
        "median_factor": _mean([item.median_factor for item in errors]),
        "within_one_sigma": _mean([item.within_sigma for item in errors]),
    }


def _table(name: str, errors: Sequence[FrameErrors]) -> Table:
    table = Table(title=f"{name}: {len(errors)} frames", title_justify="left")
    for heading in ("depth from", "frames", "scale", *(heading for heading, _ in _COLUMNS)):
        table.add_column(heading, justify="left" if heading in ("depth from", "scale") else "right")
    rows = summarise(errors)
    for row in rows:
        if row.method not in (Method.GROUND_SCALED, Method.NETWORK_THERE):
            table.add_row(*_cells(row, "median", row.scaled))
    table.add_section()
    for row in rows:
        table.add_row(*_cells(row, "metres", row.unscaled))
    return table


def _cells(row: MethodSummary, scale: str, metrics: DepthMetrics | None) -> list[str]:
    numbers = (
        ["-"] * len(_COLUMNS) if metrics is None else [f"{getattr(metrics, key):.3f}" for _, key in _COLUMNS]
    )
    return [row.method.value, str(row.frames), scale, *numbers]


def _numbers(metrics: DepthMetrics | None) -> dict[str, float] | None:
    return None if metrics is None else {key: round(value, 4) for key, value in metrics.as_dict().items()}


def _abs_rel(metrics: DepthMetrics | None) -> float | None:
    return None if metrics is None else round(metrics.abs_rel, 4)


def _mean(values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return round(sum(known) / len(known), 4) if known else None


def _ranges(seeds: Sequence[int]) -> str:
    """Whole numbers as text: 1000 to 1005, or each by itself."""
    if len(seeds) > 2 and list(seeds) == list(range(seeds[0], seeds[-1] + 1)):
        return f"{seeds[0]} to {seeds[-1]}"
    return ", ".join(str(seed) for seed in seeds)
