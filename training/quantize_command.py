"""`uavdepth quantize`.

Heavy packages are imported when the command runs, so that its help is fast.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from training.extras import needs_extra

if TYPE_CHECKING:
    from training.evaluation_frames import EvaluationPlan

_RANGES, _JUDGES, _FRAMES = "900-901", "902-903", 12


def quantize(
    network: Annotated[str, typer.Argument(help="Network: an ONNX file, or the name of one that ships.")],
    output: Annotated[
        Path | None, typer.Argument(help="File to write.", show_default="NAME-int8.onnx beside the network")
    ] = None,
    data: Annotated[
        Path | None, typer.Option(help="Folder where rendered frames are kept for the next time.")
    ] = None,
    seeds: Annotated[str, typer.Option(help="Seeds whose worlds give the ranges, 900 to 999.")] = _RANGES,
    judged_by: Annotated[str, typer.Option(help="Seeds whose worlds tell the cost, 900 to 999.")] = _JUDGES,
    frames_per_seed: Annotated[int, typer.Option(min=1, help="Frames of each world.")] = _FRAMES,
    keep: Annotated[
        str | None,
        typer.Option(
            help="Parts of names of weights, by commas, that stay in floating point.",
            show_default="first and last layers of our networks",
        ),
    ] = None,
) -> None:
    """Write a network's 8-bit file, if Abs Rel grows by at most 2 % with any set of hints.

    Ranges of values and the cost come from worlds that neither training nor tests have. The service takes the
    file by itself where that was measured to be faster: `[model] precision`.
    """
    with needs_extra("quantize", "train"):
        from training.quantization import KEPT_IN_FLOAT
        from training.quantization import quantize as write_int8
        from uavdepth.model.int8_file import int8_beside
        from uavdepth.model.network_file import find_network

    source = find_network(network)
    target = output or int8_beside(source)
    kept = KEPT_IN_FLOAT if keep is None else tuple(part for part in keep.split(",") if part)
    cost = write_int8(
        source, target, _plan(seeds, frames_per_seed, data), _plan(judged_by, frames_per_seed, data), kept
    )
    for label, lost in cost.lost.items():
        typer.echo(
            f"hints {label}: Abs Rel {cost.float_abs_rel[label]:.4f} in floating point, "
            f"{cost.int8_abs_rel[label]:.4f} in 8 bits ({lost:+.1%})"
        )
    typer.echo(f"{target}: {target.stat().st_size / 1e6:.1f} MB")


def _plan(seeds: str, frames_per_seed: int, data: Path | None) -> EvaluationPlan:
    from training.evaluation_frames import EvaluationPlan, parse_seeds
    from uavdepth.scenes import HELD_OUT_SCENES, SCENE_NAMES

    scenes = tuple(scene for scene in SCENE_NAMES if scene not in HELD_OUT_SCENES)
    return EvaluationPlan(scenes, parse_seeds(seeds), frames_per_seed, data)
