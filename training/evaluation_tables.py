"""The result of an evaluation as tables for a terminal."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from rich.table import Table

from training.evaluation import FrameErrors
from training.evaluation_bands import band_names
from training.evaluation_doubt import NOMINAL_COVERAGE, SIGMAS
from training.evaluation_obstacles import FALSE_ALARM_M, MEASURED_M
from training.evaluation_report import EvaluationReport, mean_points
from training.evaluation_sky import FAR_M
from training.evaluation_sources import CONSTANT, PERFECT, THERE, is_rescaled
from training.evaluation_summary import SourceSummary
from training.metrics import DepthMetrics

_COLUMNS = (
    ("Abs Rel", "abs_rel"),
    ("Sq Rel", "sq_rel"),
    ("RMSE", "rmse"),
    ("RMSE log", "rmse_log"),
    ("<1.25", "below_125"),
    ("<1.25^2", "below_125_2"),
    ("<1.25^3", "below_125_3"),
)
_MEDIAN, _METRES = "median", "metres"


def tables(report: EvaluationReport) -> Iterator[Table]:
    """Tables of each part of the data: errors, by distance, doubt, sky, obstacles; then one by group."""
    for name, part in report.parts.items():
        errors = report.of(part)
        if not errors:
            continue
        rows = report.summaries(errors)
        yield _seven(_title(name, part, errors), rows)
        yield _bands(f"{name}: Abs Rel by true distance", rows)
        networks = [row for row in rows if row.label in report.networks]
        if any(row.doubt is not None for row in networks):
            yield _doubt(f"{name}: sigma against the error, metric", networks)
        if any(row.sky is not None for row in networks):
            yield _sky(f"{name}: what is said of the sky", networks)
        if any(row.elements is not None for row in rows):
            yield _elements(f"{name}: nearest obstacle of each 5 degree element", rows)
    groups = [group for part in report.parts.values() for group in part]
    if len(groups) > 1:
        yield _by_group(report, groups)


def _title(name: str, part: Sequence[str], errors: Sequence[FrameErrors]) -> str:
    points = mean_points(errors)
    told = ", ".join(f"{found:g} of {asked}" for asked, found in points.items())
    return f"{name} ({', '.join(part)}): {len(errors)} frames; points found on average: {told}"


def _seven(title: str, rows: Sequence[SourceSummary]) -> Table:
    table = _table(title, ("depth from", "scale"), ("frames", *(heading for heading, _ in _COLUMNS)))
    for scale in (_MEDIAN, _METRES):
        for row in _shown(rows, scale):
            metrics = row.scaled if scale == _MEDIAN else row.metric
            if metrics is not None:
                numbers = [f"{getattr(metrics, key):.3f}" for _, key in _COLUMNS]
                table.add_row(row.label, scale, str(row.frames), *numbers)
        table.add_section()
    return table


def _shown(rows: Sequence[SourceSummary], scale: str) -> list[SourceSummary]:
    """Rows worth showing: at the truth's median every rescaled network is the same network."""
    rows = [row for row in rows if row.label != PERFECT]
    return [row for row in rows if scale == _METRES or not is_rescaled(row.label)]


def _bands(title: str, rows: Sequence[SourceSummary]) -> Table:
    table = _table(title, ("depth from", "scale"), band_names())
    for scale in (_MEDIAN, _METRES):
        for row in _shown(rows, scale):
            bands = row.scaled_bands if scale == _MEDIAN else row.metric_bands
            if any(metrics is not None for metrics, _ in bands):
                table.add_row(row.label, scale, *(_abs_rel(metrics) for metrics, _ in bands))
        table.add_section()
    if rows:
        table.add_row("pictures", "", *(str(pictures) for _, pictures in rows[0].scaled_bands))
    return table


def _doubt(title: str, rows: Sequence[SourceSummary]) -> Table:
    within = [f"<{sigma:g} sigma" for sigma in SIGMAS]
    table = _table(
        title,
        ("depth from",),
        (*within, "Abs Rel", "surest half", "share", "pooled", "rank corr."),
    )
    table.add_row("Gaussian errors", *(f"{share:.2f}" for share in NOMINAL_COVERAGE), *["-"] * 5)
    table.add_section()
    for row in rows:
        doubt = row.doubt
        if doubt is not None:
            together = doubt.pooled
            table.add_row(
                row.label,
                *(f"{share:.2f}" for share in doubt.coverage),
                f"{doubt.all_abs_rel:.3f}",
                f"{doubt.surest_abs_rel:.3f}",
                _number(doubt.surest_abs_rel, doubt.all_abs_rel),
                _number(together.surest_abs_rel, together.all_abs_rel),
                f"{doubt.rank_correlation:.2f}",
            )
    return table


def _sky(title: str, rows: Sequence[SourceSummary]) -> Table:
    table = _table(title, ("depth from",), (f">{FAR_M:g} m", "median sigma", "sigma elsewhere"))
    for row in rows:
        sky = row.sky
        if sky is not None:
            sigmas = ("-" if sigma is None else f"{sigma:.2f}" for sigma in (sky.sigma, sky.sigma_elsewhere))
            table.add_row(row.label, _percent(sky.far_share), *sigmas)
    return table


def _elements(title: str, rows: Sequence[SourceSummary]) -> Table:
    span = f"{MEASURED_M[0]:g}-{MEASURED_M[1]:g} m"
    table = _table(
        title,
        ("depth from",),
        (
            span,
            "median error",
            "missed",
            "clear",
            "with both beside",
            "unknown",
            f"alarm <{FALSE_ALARM_M:g} m",
        ),
    )
    for row in rows:
        found = row.elements
        if found is not None:
            clear = found.missed_clear / found.measured if found.measured else None
            table.add_row(
                row.label,
                str(found.measured),
                _percent(found.median_error),
                _percent(found.missed_share),
                _percent(clear),
                _percent(found.alone_share),
                _percent(found.unknown_share),
                _percent(found.false_alarm_share),
            )
    return table


def _by_group(report: EvaluationReport, groups: Sequence[str]) -> Table:
    """Abs Rel of the network in each group, and of the trivial answer that needs no knowledge."""
    labels = [label for label in (*report.networks, CONSTANT) if label != THERE]
    table = _table("by group: Abs Rel, median-scaled / metric", ("", "frames"), labels)
    for group in groups:
        errors = report.of([group])
        rows = {row.label: row for row in report.summaries(errors)}
        cells = [
            f"{_abs_rel(rows[label].scaled)} / {_abs_rel(rows[label].metric)}" if label in rows else "-"
            for label in labels
        ]
        table.add_row(group, str(len(errors)), *cells)
    return table


def _table(title: str, texts: Sequence[str], numbers: Sequence[str]) -> Table:
    table = Table(title=title, title_justify="left")
    for heading in texts:
        table.add_column(heading)
    for heading in numbers:
        table.add_column(heading, justify="right")
    return table


def _abs_rel(metrics: DepthMetrics | None) -> str:
    return "-" if metrics is None else f"{metrics.abs_rel:.3f}"


def _number(part: float, whole: float) -> str:
    return f"{part / whole:.2f}" if whole > 0 else "-"


def _percent(share: float | None) -> str:
    return "-" if share is None else f"{100 * share:.1f} %"
