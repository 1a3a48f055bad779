"""What an evaluation found, group by group, against its targets."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from service.motion_evaluation.evaluation import Errors
from service.motion_evaluation.point_errors import PointSummary
from service.motion_evaluation.scale_errors import CONVERGED, SETTLED_S, ScaleSummary

POINTS_MEDIAN = 0.05
HINTED_ABS_REL = 0.12
SCALE_MEDIAN = 0.05
SCALE_P95 = CONVERGED
KITTI_ABS_REL = 0.20


@dataclass(frozen=True)
class GroupSummary:
    """One journey, or several of a kind.

    Args:
        points: triangulated points; None where nothing is known to measure them by.
        hinted_abs_rel, unhinted_abs_rel: of the network with live hints and without; None where the network
            takes none or nothing is known.
        held_out_abs_rel: of the network that got every second point, at the others.
        scales: of the estimator, by depth and sources ("network, both").
    """

    points: PointSummary | None
    hinted_abs_rel: float | None
    unhinted_abs_rel: float | None
    held_out_abs_rel: float | None
    scales: Mapping[str, ScaleSummary | None]

    @classmethod
    def of(cls, errors: Errors) -> GroupSummary:
        """Sum up."""
        return cls(
            errors.points.summary(),
            _mean(errors.hinted),
            _mean(errors.unhinted),
            _mean(errors.held_out),
            {f"{depth}, {sources}": each.summary() for (depth, sources), each in errors.scales.items()},
        )

    def as_json(self) -> dict[str, Any]:
        """Plain values; what is not known is null."""
        return {
            "points": None if self.points is None else asdict(self.points),
            "hinted_abs_rel": self.hinted_abs_rel,
            "unhinted_abs_rel": self.unhinted_abs_rel,
            "held_out_abs_rel": self.held_out_abs_rel,
            "scales": {
                name: None if each is None else {k: _plain(v) for k, v in asdict(each).items()}
                for name, each in self.scales.items()
            },
        }


@dataclass(frozen=True)
class Target:
    """One sentence of what is wanted.

    Args:
        what: in words, with the limit.
        found: the figure, or None where nothing was measured.
        met: whether it holds.
    """

    what: str
    found: float | None
    met: bool


def targets(groups: Mapping[str, GroupSummary]) -> list[Target]:
    """The targets that these groups can be held against."""
    found: list[Target] = []
    for name, group in groups.items():
        if name in ("flight", "recorded"):
            median = None if group.points is None else group.points.median
            found.append(_most(f"{name}: points, median error", median, POINTS_MEDIAN))
            if group.hinted_abs_rel is not None:
                what = f"{name}: Abs Rel of the network with live hints"
                found.append(_most(what, group.hinted_abs_rel, HINTED_ABS_REL))
            for depth in ("network", "truth relative", "truth affine"):
                found += _scale_targets(f"{name}: scale of {depth}", group.scales.get(f"{depth}, both"))
        elif name == "kitti raw":
            scale = group.scales.get("network, points")
            if group.hinted_abs_rel is not None:
                what = f"{name}: Abs Rel of the network with live hints"
                found.append(_most(what, group.hinted_abs_rel, KITTI_ABS_REL))
            elif scale is not None:
                found.append(_most(f"{name}: Abs Rel with the estimator", scale.abs_rel, KITTI_ABS_REL))
    return found


def _scale_targets(what: str, scale: ScaleSummary | None) -> list[Target]:
    if scale is None:
        return []
    return [
        _most(f"{what}, median error", scale.median, SCALE_MEDIAN),
        _most(f"{what}, 95th percentile", scale.p95, SCALE_P95),
        _most(f"{what}, seconds of motion until within 15 %", scale.converged_s, SETTLED_S),
    ]


def _most(what: str, found: float | None, limit: float) -> Target:
    if found is None or not math.isfinite(found):
        return Target(f"{what} <= {limit:g}", None, met=False)
    return Target(f"{what} <= {limit:g}", found, found <= limit)


def _mean(values: list[float]) -> float | None:
    return float(np.mean(values)) if values else None


def _plain(value: Any) -> Any:
    return None if isinstance(value, float) and not math.isfinite(value) else value
