"""The figures of an evaluation."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np

from service.flight_evaluation.closed_loop import Flown, Outcome
from service.flight_evaluation.evaluation import FLAVORS, Evaluation, Evidence
from service.flight_evaluation.judgement import together
from service.flight_evaluation.sight import DepthKind
from service.flight_evaluation.survey import Looked

ALL = "all scenes"


def report(evaluation: Evaluation, machine: str, date: str, model: str) -> dict[str, Any]:
    """The whole result as JSON.

    The figures of a scene are of the network's depth where it was flown; those of the true depth then stand
    beside them under `with_true_depth`.

    Args:
        evaluation: a finished run.
        machine, date: where and when.
        model: which network, in words.
    """
    plan = evaluation.plan
    first = plan.kinds[-1]
    scenes: dict[str, Any] = {}
    for name in (*plan.scenes, ALL):
        figures = _figures(first, _of(evaluation, first, name))
        if DepthKind.TRUE in plan.kinds and first is not DepthKind.TRUE:
            figures["with_true_depth"] = _figures(DepthKind.TRUE, _of(evaluation, DepthKind.TRUE, name))
        scenes[name] = figures
    camera = evaluation.settings.camera
    everything = scenes.pop(ALL)
    return {
        "machine": machine,
        "date": date,
        "model": model,
        "latency_ms": round(1000 * plan.latency_s),
        "sigma_factor": evaluation.settings.scan.sigma_factor,
        "picture": f"{camera.width}x{camera.height}",
        "frames_per_s": camera.fps,
        "speed_of_approaches_mps": 3.0,
        "seeds": "validation" if plan.validation else "test",
        "worlds_of_each_scene": plan.worlds,
        "worlds": [str(light) for light in _lights(evaluation)],
        "scenes": scenes,
        "all": everything,
        "by": {
            kind.value: {
                "manoeuvre": _grouped(_looked(evaluation, kind), lambda item: str(item.manoeuvre or "pose")),
                "light": _grouped(_looked(evaluation, kind), lambda item: str(item.world.light)),
                "speed": _grouped(
                    [item for item in _looked(evaluation, kind) if item.speed_mps > 0],
                    lambda item: f"{_rounded(item.speed_mps)} m/s",
                ),
            }
            for kind in plan.kinds
        },
    }


def _of(evaluation: Evaluation, kind: DepthKind, name: str) -> list[Evidence]:
    by_scene = evaluation.evidence[kind]
    return list(by_scene.values()) if name == ALL else [by_scene[name]]


def _looked(evaluation: Evaluation, kind: DepthKind) -> list[Looked]:
    return [item for part in evaluation.evidence[kind].values() for item in (*part.poses, *part.looked)]


def _lights(evaluation: Evaluation) -> list[str]:
    lights = {str(item.world.light) for kind in evaluation.plan.kinds for item in _looked(evaluation, kind)}
    return sorted(lights)


def _figures(kind: DepthKind, parts: Sequence[Evidence]) -> dict[str, Any]:
    looked = [item for part in parts for item in (*part.poses, *part.looked)]
    errors = [error for part in parts for error in part.bearing_errors_deg]
    approaches = [flown for part in parts for flown in part.approaches]
    corridors = [flown for part in parts for flown in part.corridors]
    scales = [item.scale_error for item in looked if item.scale_error is not None]
    return {
        "depth": kind.value,
        **_elements(looked),
        "scale_error_median": _percentile(scales, 50),
        "scale_error_p95": _percentile(scales, 95),
        "bearing_error_p95_deg": _percentile([abs(error) for error in errors], 95),
        "bearing_error_median_deg": _percentile(errors, 50),
        "bearing_messages": len(errors),
        "approaches": _approaches(approaches),
        "approaches_by_autopilot": {
            flavor: _approaches([flown for flown in approaches if flown.flavor == flavor])
            for flavor in FLAVORS
        },
        "stop_distance_m": _spread(
            [
                flown.ahead_m
                for flown in approaches
                if flown.outcome is Outcome.STOPPED and flown.ahead_m is not None
            ]
        ),
        "corridors": {
            "tried": len(corridors),
            "passed": _count(corridors, Outcome.PASSED),
            "stopped": _count(corridors, Outcome.STOPPED) + _count(corridors, Outcome.LATE),
            "touched": _count(corridors, Outcome.TOUCHED),
        },
    }


def _elements(looked: Sequence[Looked]) -> dict[str, Any]:
    tally = together(item.tally for item in looked if item.tally is not None)
    troubles = Counter(item.trouble for item in looked if item.trouble is not None)
    return {
        "pictures": len(looked),
        "pictures_not_told": sum(troubles.values()),
        "troubles": dict(troubles),
        "elements": tally.looked_at,
        "measured": tally.measured,
        "missed": tally.missed,
        "false": tally.false,
        "nearest_error_median": _finite(tally.nearest_error_median),
        "element_error_median": tally.element_error_median,
        "missed_rate": tally.missed_rate,
        "false_rate": tally.false_rate,
        "unknown_rate": tally.unknown_rate,
    }


def _grouped(looked: Iterable[Looked], key: Callable[[Looked], str]) -> dict[str, Any]:
    groups: dict[str, list[Looked]] = {}
    for item in looked:
        groups.setdefault(key(item), []).append(item)
    return {
        name: {
            field: _elements(groups[name])[field]
            for field in (
                "pictures",
                "pictures_not_told",
                "nearest_error_median",
                "missed_rate",
                "false_rate",
            )
        }
        for name in sorted(groups)
    }


def _approaches(flights: Sequence[Flown]) -> dict[str, int]:
    return {
        "tried": len(flights),
        "stopped": _count(flights, Outcome.STOPPED),
        "touched": _count(flights, Outcome.TOUCHED),
    }


def _count(flights: Sequence[Flown], outcome: Outcome) -> int:
    return sum(flown.outcome is outcome for flown in flights)


def _spread(values: Sequence[float]) -> dict[str, float] | None:
    if not values:
        return None
    return {"least": min(values), "median": float(np.median(values)), "most": max(values)}


def _percentile(values: Sequence[float], percent: float) -> float | None:
    return float(np.percentile(values, percent)) if values else None


def _finite(value: float | None) -> float | None:
    """JSON has no infinity: more than half of the nearest obstacles were not told."""
    return None if value is None or not np.isfinite(value) else value


def _rounded(speed_mps: float) -> float:
    return round(2.0 * speed_mps) / 2.0
