"""The ablation as a picture, as the paper's figure 6: four errors of four variants."""

from __future__ import annotations

from pathlib import Path

from training.comparison.plan import SCENES
from training.comparison.tables import ABLATION, COLUMNS, label, read_results
from training.errors import EvaluationError

FIGURE = "ablation.png"
_ERRORS = COLUMNS[:4]
_COLORS = ("#bbbbbb", "#88bbdd", "#4488bb", "#224466")
"""Light to dark, so that they are told apart without colours."""


def write_figure(folder: Path) -> Path:
    """Draw `ablation.png` beside the results' folder and give its path back.

    Raises:
        EvaluationError: no variant has a result.
    """
    # pyplot would look for a screen; the canvas alone needs none.
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    results = read_results(folder)
    names = [name for name in ABLATION if name in results]
    if not names:
        raise EvaluationError(f"no variant of the ablation has a result in {folder}")
    figure = Figure(figsize=(11.0, 5.4), layout="constrained")
    axes = figure.subplots(len(SCENES), len(_ERRORS), squeeze=False)
    for row, scene in zip(axes, SCENES, strict=True):
        for axis, column in zip(row, _ERRORS, strict=True):
            values = [column.of(results[name].metrics(scene)) for name in names]
            bars = axis.bar([label(name) for name in names], values, color=_COLORS[: len(names)])
            axis.bar_label(bars, fmt="%.3f", fontsize=7)
            axis.set_ylim(0.0, 1.15 * max(values))
            axis.set_title(f"{scene}: {column.heading}", fontsize=9)
            axis.set_xticks(range(len(names)), [label(name).replace(" + ", "\n+ ") for name in names])
            axis.tick_params(labelsize=6)
            axis.spines[["top", "right"]].set_visible(False)
    path = folder.parent / FIGURE
    FigureCanvasAgg(figure)
    figure.savefig(path)
    return path
