"""The tables of the comparison as Markdown, from the committed results."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from training.comparison.plan import SCENES
from training.comparison.result import ComparisonResult
from training.errors import EvaluationError
from training.metrics import DepthMetrics
from training.networks.catalogue import NETWORK_NAMES, PROPOSED

TABLES = "comparison.md"
BASELINES = (PROPOSED, "hr-depth", "monodepth2")
"""In the order of the paper's table 3."""
ABLATION = ("bl", "bl+fan", "bl+fan+se", "bl+fan+eca")
"""In the order of the paper's figure 6."""

LABELS = {"monodepth2": "Monodepth2", "hr-depth": "HR-Depth", "bl": "BL", "constant depth": "Constant depth"}
TARGETS = {"mountain": 0.079, "city": 0.055}
"""By how much the paper's network lies below Monodepth2 in Abs Rel: (0.229 - 0.211) / 0.229 and so on."""


@dataclass(frozen=True)
class Column:
    """One of the seven metrics: its heading, its field, and which direction is better."""

    heading: str
    field: str
    more_is_better: bool = False

    def of(self, metrics: DepthMetrics) -> float:
        """Its value."""
        return metrics.as_dict()[self.field]


COLUMNS = (
    Column("Abs Rel", "abs_rel"),
    Column("Sq Rel", "sq_rel"),
    Column("RMSE", "rmse"),
    Column("RMSE log", "rmse_log"),
    Column("< 1.25", "below_125", more_is_better=True),
    Column("< 1.25²", "below_125_2", more_is_better=True),
    Column("< 1.25³", "below_125_3", more_is_better=True),
)


def label(network: str) -> str:
    """A network's name as people write it."""
    text = LABELS.get(network, network.upper().replace("+", " + "))
    return f"{text} (proposed)" if network == PROPOSED else text


def read_results(folder: Path) -> dict[str, ComparisonResult]:
    """The results that are there, by network.

    Raises:
        EvaluationError: none at all, a broken one, or results of different settings.
    """
    found = {
        name: ComparisonResult.read(folder / f"{name}.json")
        for name in NETWORK_NAMES
        if (folder / f"{name}.json").exists()
    }
    if not found:
        raise EvaluationError(f"no results in {folder}: `uavdepth compare run NETWORK` makes one")
    budgets = {name: _budget(result) for name, result in found.items()}
    first, *others = budgets.items()
    for name, budget in others:
        if budget != first[1]:
            raise EvaluationError(
                f"{name} was trained with {budget}, {first[0]} with {first[1]}: they do not compare"
            )
    return found


def _budget(result: ComparisonResult) -> dict[str, object]:
    """Everything that must be alike."""
    same = {key: value for key, value in result.settings.items() if key not in ("network", "precision")}
    return {**same, "images": result.images}


def write_tables(folder: Path) -> Path:
    """Write `comparison.md` beside the results' folder and give its path back."""
    results = read_results(folder)
    path = folder.parent / TABLES
    path.write_text(_document(results), encoding="utf-8")
    return path


def _document(results: dict[str, ComparisonResult]) -> str:
    any_result = next(iter(results.values()))
    settings = any_result.settings
    parts = [
        "# The paper's comparison on rendered flights",
        "",
        "Made by `uavdepth compare tables` from the files in `comparison/`; `uavdepth compare run NETWORK` "
        "repeats a run. Do not edit.",
        "",
        f"Every network: self-supervised, {any_result.images:,} target pictures of "
        f"{settings['width']}x{settings['height']}, batch {settings['batch']}, Adam at "
        f"{settings['learning_rate']:g} and {settings['learning_rate'] * settings['drop_to']:g} from "
        f"{100 * settings['drop_at']:g} % on, smoothness {settings['loss']['smoothness']:g}, seed "
        f"{settings['seed']}, the same pose network, the same start of encoder and pose network. One network "
        "learns both scenes. The paper's smoothness is 0.04. Errors are median-scaled per picture, depth up "
        "to 80 m, at 640x480.",
        "",
        *_table_3(results),
        *_ablation(results),
        *_costs(results),
    ]
    missing = [name for name in NETWORK_NAMES if name not in results]
    if missing:
        parts += ["", f"Not there yet: {', '.join(label(name) for name in missing)}."]
    return "\n".join(parts) + "\n"


def _table_3(results: dict[str, ComparisonResult]) -> list[str]:
    names = [name for name in BASELINES if name in results]
    lines = ["## Against the baselines (as the paper's table 3)", ""]
    for scene in SCENES:
        first = results[names[0]] if names else next(iter(results.values()))
        pictures = first.scenes[scene]["pictures"]
        lines += [f"### {scene.capitalize()}, {pictures:,} test pictures", "", *_head("network")]
        lines += _rows({name: results[name].metrics(scene) for name in names}, best=True)
        lines += _rows({"constant depth": first.constant(scene)})
        verdict = _verdict(results, scene)
        lines += ["", *verdict, ""] if verdict else [""]
    return lines


def _verdict(results: dict[str, ComparisonResult], scene: str) -> list[str]:
    if PROPOSED not in results or "monodepth2" not in results:
        return []
    proposed, plain = results[PROPOSED].metrics(scene), results["monodepth2"].metrics(scene)
    gain = 1.0 - proposed.abs_rel / plain.abs_rel
    rivals = [results[name].metrics(scene) for name in BASELINES if name in results and name != PROPOSED]
    won = sum(all(_better(column, proposed, rival) for rival in rivals) for column in COLUMNS)
    side = "below" if gain >= 0 else "above"
    return [
        f"Abs Rel of the proposed network lies {abs(gain):.1%} {side} Monodepth2's (the paper: "
        f"{TARGETS[scene]:.1%} below); it is the best in {won} of 7 metrics."
    ]


def _better(column: Column, one: DepthMetrics, other: DepthMetrics) -> bool:
    difference = column.of(one) - column.of(other)
    return difference > 0 if column.more_is_better else difference < 0


def _ablation(results: dict[str, ComparisonResult]) -> list[str]:
    names = [name for name in ABLATION if name in results]
    if not names:
        return []
    lines = ["## Ablation (as the paper's figure 6)", "", "![Ablation](ablation.png)", ""]
    for scene in SCENES:
        lines += [f"### {scene.capitalize()}", "", *_head("variant")]
        lines += _rows({name: results[name].metrics(scene) for name in names}, best=True)
        lines.append("")
    return lines


def _costs(results: dict[str, ComparisonResult]) -> list[str]:
    lines = [
        "## What they cost",
        "",
        "| network | parameters, M | multiply-adds, G | training, minutes | date |",
        "|---|---|---|---|---|",
    ]
    for name, result in results.items():
        lines.append(
            f"| {label(name)} | {result.parameters / 1e6:.2f} | {result.multiply_adds / 1e9:.2f} | "
            f"{result.trained_minutes:.0f} | {result.date[:10]} |"
        )
    machines = sorted({result.machine for result in results.values()})
    note = (
        f"One picture at the runs' size. Trained with one thread on {'; '.join(machines)}; other work ran on "
        "the machine, so the minutes tell little."
    )
    return [*lines, "", note]


def _head(first: str) -> list[str]:
    return [
        f"| {first} | " + " | ".join(column.heading for column in COLUMNS) + " |",
        "|---" * (len(COLUMNS) + 1) + "|",
    ]


def _rows(values: Mapping[str, DepthMetrics], *, best: bool = False) -> list[str]:
    """A line for each network; the best of each column bold if asked for."""
    lines = []
    for name, own in values.items():
        rivals = [other for key, other in values.items() if key != name]
        cells = []
        for column in COLUMNS:
            text = f"{column.of(own):.3f}"
            wins = best and rivals and all(_better(column, own, rival) for rival in rivals)
            cells.append(f"**{text}**" if wins else text)
        lines.append(f"| {label(name)} | " + " | ".join(cells) + " |")
    return lines
