"""`uavdepth blend`.

Heavy packages are imported when the command runs, so that its help is fast.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from training.errors import CheckpointError
from training.extras import needs_extra


def blend(
    output: Annotated[Path, typer.Argument(help="Checkpoint to write.")],
    checkpoints: Annotated[list[Path], typer.Argument(help="Checkpoints of `uavdepth train`, two or more.")],
    shares: Annotated[
        str | None, typer.Option(help="Share of each, by commas, together 1.", show_default="alike")
    ] = None,
) -> None:
    """Take the mean of several runs' weights, where one began with the other's or all with the same.

    A run on pictures of a new look forgets some of the old ones; half way between it and the run that it
    began with, most of both is kept.
    """
    with needs_extra("blend", "train"):
        from training.blending import blend as blended
        from training.checkpoint import Checkpoint

    runs = [Checkpoint.load(path) for path in checkpoints]
    wanted = [1.0 / len(runs)] * len(runs) if shares is None else _parsed(shares)
    found = blended(runs, wanted)
    found.save(output)
    parts = " + ".join(f"{share:.3g} {path}" for share, path in zip(wanted, checkpoints, strict=True))
    typer.echo(f"{output}: {parts}, {found.images} pictures together")


def _parsed(text: str) -> list[float]:
    try:
        return [float(part) for part in text.split(",")]
    except ValueError as error:
        raise CheckpointError(f"shares are {text!r}: numbers by commas are needed, as 0.5,0.5") from error
