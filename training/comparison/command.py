"""`uavdepth compare`: repeats a run of the comparison, and makes its tables."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from training.extras import needs_extra

compare_app = typer.Typer(
    help="The paper's comparison on rendered flights.", no_args_is_help=True, add_completion=False
)
DataFolder = Annotated[
    Path, typer.Option(help="Folder of the rendered sets (about 10 GB); what is missing is rendered.")
]
ResultFolder = Annotated[Path, typer.Option(help="Folder of the results, one JSON file a network.")]


@compare_app.command()
def run(
    network: Annotated[str, typer.Argument(help="A name that `uavdepth networks` lists.")],
    data: DataFolder = Path("comparison_data"),
    output: Annotated[Path, typer.Option(help="Folder of the runs: checkpoints and TensorBoard.")] = Path(
        "comparison_runs"
    ),
    results: ResultFolder = Path("docs/comparison"),
    threads: Annotated[int, typer.Option(min=1, help="Two runs of one thread beat one of two.")] = 1,
) -> None:
    """Train one network as all others and measure it on worlds that no network has seen.

    A run that was cut off goes on where its checkpoint stands.
    """
    with needs_extra("compare run", "train"):
        import cv2
        import torch

        from training.comparison.run import make_start, measure_run, render_sets, train_run

    cv2.setNumThreads(1)
    torch.set_num_threads(threads)
    with needs_extra("compare run", "sim"):
        render_sets(data, _say)
    make_start(data, _say)
    folder = output / network
    train_run(network, data, folder)
    typer.echo(f"{measure_run(folder, data).write(results)}")


@compare_app.command()
def tables(results: ResultFolder = Path("docs/comparison")) -> None:
    """Write comparison.md and ablation.png from the results that are there."""
    with needs_extra("compare tables", "train"):
        from training.comparison.figure import write_figure
        from training.comparison.tables import write_tables
    for path in (write_tables(results), write_figure(results)):
        typer.echo(f"{path}")


def _say(text: str) -> None:
    typer.echo(text, err=True)
