"""An evaluation from beginning to end: every frame measured, a report and the rows of a picture sheet."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, TypeVar

from training.data.seed_split import SeedSplit
from training.errors import EvaluationError
from training.evaluation import FrameErrors, MeasuredFrame, measure_frame
from training.evaluation_frames import EvaluationPlan
from training.evaluation_kitti import KittiFrame, caution, kitti_frames, measure_kitti_frame, sequence_names
from training.evaluation_report import HELD_OUT, SEEN, EvaluationReport
from training.evaluation_sheet import SheetRow, spread_evenly
from training.evaluation_sources import Sources
from training.metrics import DEPTH_CAP_M
from training.sequences.errors import BrokenFrameError
from training.sequences.kitti_raw import open_kitti_raw
from uavdepth.model.depth_model import DepthModel

SHEET_ROWS = 24
KITTI_SHEET_ROWS = 10

Item = TypeVar("Item")


@dataclass(frozen=True)
class Evaluation:
    """Result of an evaluation: the report, and rows for a sheet."""

    report: EvaluationReport
    rows: tuple[SheetRow, ...]


def evaluate_rendered(model: DepthModel, plan: EvaluationPlan, point_counts: Sequence[int]) -> Evaluation:
    """Measure a network on rendered worlds that it was not trained on.

    Raises:
        EvaluationError: an impossible count of points, or a stored frame whose parts do not fit.
        SceneError: a world that cannot be built.
        TrainingDataError: a store that cannot be read.
    """
    sources = Sources(model, point_counts)
    shown = indices_for_sheet(plan)
    errors: list[FrameErrors] = []
    rows: list[SheetRow] = []
    for number, item in enumerate(_with_progress(plan.frames(), plan.frames_count)):
        measured = measure_frame(sources, item)
        errors.append(measured.errors)
        if number in shown:
            rows.append(measured.row)
    data = (
        f"rendered frames of {plan.split.name.lower()} seeds {_ranges(plan.seeds)} of "
        f"{', '.join(plan.scenes)}, depth below {DEPTH_CAP_M:g} m"
        f"{', surfaces changed' if plan.other_surfaces else ''}"
    )
    details = {
        "split": plan.split.name.lower(),
        "scenes": list(plan.scenes),
        "seeds": list(plan.seeds),
        "frames_per_seed": plan.frames_per_seed,
        "other_surfaces": plan.other_surfaces,
    }
    parts = {SEEN: plan.seen_scenes, HELD_OUT: plan.held_out_scenes}
    note = "" if plan.split is SeedSplit.TEST else "validation seeds: for choices, not for claims"
    return Evaluation(_report(sources, data, details, parts, errors, (), note), tuple(rows))


def evaluate_kitti(model: DepthModel, root: Path, point_counts: Sequence[int], every: int = 1) -> Evaluation:
    """Measure a network, zero-shot, on KITTI's pictures; broken ones are skipped and named.

    Args:
        model: the network.
        root: folder with the raw data's own layout.
        point_counts: how many LiDAR points are told, one mode for each.
        every: one picture of so many is taken.

    Raises:
        TrainingDataError: no drives there, or a broken calibration.
        EvaluationError: an impossible count of points, or nothing that could be measured.
    """
    sources = Sources(model, point_counts)
    frames = kitti_frames(open_kitti_raw(root), every)
    shown = set(spread_evenly(len(frames), KITTI_SHEET_ROWS))
    errors: list[FrameErrors] = []
    rows: list[SheetRow] = []
    skipped: list[str] = []

    def measure(frame: KittiFrame) -> MeasuredFrame | None:
        try:
            return measure_kitti_frame(sources, frame)
        except (BrokenFrameError, EvaluationError) as error:
            skipped.append(str(error))
            return None

    for number, frame in enumerate(_with_progress(frames, len(frames))):
        measured = measure(frame)
        if measured is not None:
            errors.append(measured.errors)
            if number in shown:
                rows.append(measured.row)
    if not errors:
        raise EvaluationError(f"none of {len(frames)} pictures in {root} could be measured: {skipped[0]}")
    names = tuple(sequence_names(frames))
    data = f"KITTI raw, zero-shot, LiDAR in the Garg crop, depth below {DEPTH_CAP_M:g} m: {', '.join(names)}"
    note = caution(len(errors))
    return Evaluation(
        _report(sources, data, {"every": every}, {"kitti": names}, errors, skipped, note), tuple(rows)
    )


def indices_for_sheet(plan: EvaluationPlan) -> set[int]:
    """Numbers of frames of the plan, as many of each scene, spread over its worlds."""
    per_scene = plan.frames_count // len(plan.scenes)
    chosen = set()
    for scene in range(len(plan.scenes)):
        for place in spread_evenly(per_scene, max(SHEET_ROWS // len(plan.scenes), 1)):
            world, frame = divmod(place, plan.frames_per_seed)
            chosen.add((world * len(plan.scenes) + scene) * plan.frames_per_seed + frame)
    return chosen


def _report(
    sources: Sources,
    data: str,
    details: dict[str, Any],
    parts: dict[str, tuple[str, ...]],
    errors: Sequence[FrameErrors],
    skipped: Sequence[str],
    note: str,
) -> EvaluationReport:
    model = sources.model
    return EvaluationReport(
        model=f"{model.card.name} ({Path(model.source).name}, {model.card.created})",
        provider=model.provider,
        precision=model.precision,
        hints=tuple(sorted(sources.takes)),
        data=data,
        details=details,
        labels=sources.labels,
        networks=sources.networks,
        parts={name: groups for name, groups in parts.items() if groups},
        errors=errors,
        date=datetime.now(UTC).isoformat(timespec="seconds"),
        note=note,
        skipped=skipped,
    )


def _with_progress(items: Iterable[Item], total: int) -> Iterator[Item]:
    """The items, with a bar on standard error that leaves standard output to the result."""
    from rich.console import Console
    from rich.progress import track

    console = Console(stderr=True)
    yield from track(
        items,
        total=total,
        description="measuring",
        console=console,
        disable=not console.is_terminal,
        transient=True,
    )


def _ranges(seeds: Sequence[int]) -> str:
    """Whole numbers as text: 1000 to 1005, or each by itself."""
    if len(seeds) > 2 and list(seeds) == list(range(seeds[0], seeds[-1] + 1)):
        return f"{seeds[0]} to {seeds[-1]}"
    return ", ".join(str(seed) for seed in seeds)
