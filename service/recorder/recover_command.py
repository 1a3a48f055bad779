"""`uavdepth recover`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def recover(
    file: Annotated[Path, typer.Argument(help="The record that was cut off (.mcap); it is not touched.")],
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="New file; NAME-recovered.mcap otherwise.")
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace an existing output.")] = False,
) -> None:
    """Rescue a record that was cut off: what can be read of it becomes a whole file."""
    from service.recorder.recover import recover as rescue

    rescued = rescue(file, output, force=force)
    ending = rescued.ending
    typer.echo(f"{rescued.output}: {rescued.messages} messages, {rescued.seconds:.1f} s")
    if ending.whole:
        typer.echo(f"{file} was whole: nothing was lost.")
    else:
        lost = ending.total_bytes - ending.good_bytes
        typer.echo(f"{file}: {ending.reason}; the last {lost} of {ending.total_bytes} bytes are lost.")
