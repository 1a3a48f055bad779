"""Land divided up: patches that keep a plane from being one tone, and plots that things stand on."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from uavdepth.scenes.corridor import Corridor
from uavdepth.scenes.mesh import MeshBuilder
from uavdepth.scenes.solids import Rect, add_slab


@dataclass(frozen=True)
class Site:
    """What every part of a world is built with."""

    rng: np.random.Generator
    builder: MeshBuilder
    corridor: Corridor


SiteKind = TypeVar("SiteKind", bound=Site)


@dataclass(frozen=True)
class PlotPlan:
    """Square plots in rows and columns around the origin.

    Args:
        around: plots from the middle to each side.
        pitch_m, lane_m: from plot to plot, and of that the way between them.
        jitter_m: by which a plot may lie farther north or south.
    """

    around: int
    pitch_m: float
    lane_m: float
    jitter_m: float = 0.0


def patch_lines(half_m: float, apart_m: float, horizon_m: float) -> NDArray[np.float64]:
    """Borders of patches that are so far apart up to `half_m`, and then one up to the horizon."""
    return np.concatenate([[-horizon_m], np.arange(-half_m, half_m + 1.0, apart_m), [horizon_m]])


def add_patches(
    builder: MeshBuilder, lines_m: NDArray[np.float64], look: Callable[[bool], tuple[str, ArrayLike]]
) -> None:
    """Level ground at height 0 between lines in both directions.

    Args:
        builder: the scene's mesh.
        lines_m: (N,) rising, the outermost at the horizon.
        look: texture and tint of the next patch, from whether it is one of the outermost.
    """
    last = len(lines_m) - 2
    for i in range(last + 1):
        for j in range(last + 1):
            texture, tint = look(i in (0, last) or j in (0, last))
            add_slab(
                builder, Rect(lines_m[i], lines_m[i + 1], lines_m[j], lines_m[j + 1]), 0.0, texture, tint
            )


def fill_plots(
    site: SiteKind,
    plan: PlotPlan,
    parts: Sequence[tuple[Callable[[SiteKind, Rect], None], float]],
    taken: Rect,
) -> None:
    """Put something on every plot that lies off the corridor and off `taken`.

    Args:
        site: what is built.
        plan: where plots lie.
        parts: makers of what stands on one, with how often each is drawn.
        taken: land that something stands on already.
    """
    shares = np.array([share for _, share in parts])
    half = 0.5 * (plan.pitch_m - plan.lane_m)
    for i in range(-plan.around, plan.around + 1):
        for j in range(-plan.around, plan.around + 1):
            aside = site.rng.uniform(-plan.jitter_m, plan.jitter_m) if plan.jitter_m else 0.0
            north, east = plan.pitch_m * i + aside, plan.pitch_m * j
            plot = Rect(north - half, north + half, east - half, east + half)
            make, _ = parts[int(site.rng.choice(len(parts), p=shares / shares.sum()))]
            low, high = (plot.north_low_m, plot.east_low_m), (plot.north_high_m, plot.east_high_m)
            if site.corridor.is_free(low, high) and not plot.overlaps(taken):
                make(site, plot)
