"""An evaluation as pictures."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from service.flight_evaluation.closed_loop import SPEED_MPS, Outcome
from service.flight_evaluation.configuration import MARGIN
from service.flight_evaluation.evaluation import Evaluation, Evidence

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_COLORS = {
    Outcome.STOPPED: "tab:blue",
    Outcome.PASSED: "tab:green",
    Outcome.TOUCHED: "tab:red",
    Outcome.LATE: "tab:orange",
}


def plots_are_possible() -> bool:
    """Whether matplotlib is there (extra `train`)."""
    try:
        import matplotlib  # noqa: F401
    except ImportError:
        return False
    return True


def draw(evaluation: Evaluation, folder: Path) -> list[Path]:
    """Write the plots, one file for each kind of depth and part, and return their paths."""
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for kind, scenes in evaluation.evidence.items():
        parts = list(scenes.values())
        paths.append(_elements(parts, folder / f"elements_{kind}.png", f"{kind} depth"))
        paths.append(_flights(parts, folder / f"flights_{kind}.png", f"{kind} depth"))
    return paths


def _elements(parts: list[Evidence], path: Path, title: str) -> Path:
    """Told against true distance of each element, and the share missed and false by distance."""
    figure, axes = _figure(len(parts), title)
    for part, ax in zip(parts, axes, strict=True):
        pairs = np.concatenate([np.empty((0, 2)), *(item.points for item in (*part.poses, *part.looked))])
        ax.plot([0, 20], [0, 20], color="grey", linewidth=0.8)
        ax.plot(pairs[:, 1], pairs[:, 0], ".", markersize=2, alpha=0.4)
        ax.set(
            title=part.scene, xlim=(0, 20), ylim=(0, 20), xlabel="true, m", ylabel="told, m", aspect="equal"
        )
    return _save(figure, path)


def _flights(parts: list[Evidence], path: Path, title: str) -> Path:
    """Way to the obstacle over time for approaches, way flown for corridors."""
    figure, axes = _figure(len(parts), title)
    for part, ax in zip(parts, axes, strict=True):
        for flown in part.approaches:
            times, ways = zip(*flown.path_m, strict=True)
            left = flown.route.length_m - np.array(ways)
            ax.plot(
                times, left, color=_COLORS[flown.outcome], linestyle="-" if flown.flavor == "px4" else "--"
            )
        ax.axhline(MARGIN, color="grey", linewidth=0.8)
        ax.axhline(0.0, color="black", linewidth=1.0)
        ax.set(
            title=part.scene,
            xlabel=f"s, stick at {SPEED_MPS:g} m/s",
            ylabel="to the obstacle, m",
            ylim=(-1, 22),
        )
    return _save(figure, path)


def _figure(count: int, title: str) -> tuple[Any, list[Axes]]:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(3.4 * count, 3.6), layout="constrained")
    figure.suptitle(title)
    return figure, list(np.atleast_1d(figure.subplots(1, count)))


def _save(figure: Any, path: Path) -> Path:
    figure.savefig(path, dpi=110)
    return path
